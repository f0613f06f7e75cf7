// Whatever write of a checkpoint fails: the one before stays, whole, or the new one is, and a render that is not to
// stop goes on.
#include "tests/engine/stopped_render.h"
#include "tests/support/faulty_file_system.h"

namespace shoal::testing {
namespace {

class CheckpointFaults : public StoppedRender {
 protected:
  void SetUp() override {
    StoppedRender::SetUp();
    picture_.width = 16, picture_.height = 12;
  }

  FaultyFileSystem faulty_{files_};
};

TEST_F(CheckpointFaults, AtAnyFileCallTheOldOrTheNewOneIsWhole) {
  const RenderResult expected = whole();
  make_checkpoint();
  const std::vector<std::byte> before = files_.contents(kCheckpoint);
  for (const Fault fault : {Fault::kIoError, Fault::kDiskFull}) {
    uint64_t failures = 0;
    for (uint64_t call = 0;; ++call) {
      files_.put(kCheckpoint, before);
      faulty_.arm(fault, call);
      const auto result = stopped_after(0, kRenderWays[call % std::size(kRenderWays)], faulty_);
      const bool harmed = faulty_.calls() > call;
      faulty_.arm(Fault::kNone, 0);
      EXPECT_EQ(files_.names(), std::vector<std::string>{kCheckpoint}) << "call " << call;
      ASSERT_FALSE(result.ok());
      if (harmed) {
        EXPECT_EQ(result.error().code, ErrorCode::kStorage) << result.error().message;
        EXPECT_EQ(files_.contents(kCheckpoint), before) << "call " << call;
        ++failures;
      }
      const auto gone_on = resumed();
      ASSERT_TRUE(gone_on.ok()) << "call " << call << ": " << gone_on.error().message;
      expect_same(gone_on.value(), expected, "call " + std::to_string(call));
      if (!harmed || HasFailure()) break;
    }
    EXPECT_GT(failures, 4u);
  }
}

TEST_F(CheckpointFaults, ADiskThatIsFullIsSaidOnceAndTheRenderGoesOn) {
  const RenderResult expected = whole();
  for (const RenderVariation& way : {kRenderWays[0], kRenderWays[1], kRenderWays[2], kRenderWays[3]}) {
    warnings_.clear();
    faulty_.arm(Fault::kDiskFull, 0, true);
    const auto result = rendered(faulty_, way, {.path = kCheckpoint, .every_seconds = 1e-4});
    ASSERT_TRUE(result.ok()) << result.error().message;
    expect_same(result.value(), expected, way.name);
    ASSERT_EQ(warnings_.size(), 1u);
    EXPECT_NE(warnings_[0].find("the checkpoint could not be written: "), std::string::npos) << warnings_[0];
    EXPECT_TRUE(files_.names().empty());
  }
}

TEST_F(CheckpointFaults, ABitThatFlipsOnTheWayBackIsSeen) {
  make_checkpoint();
  uint64_t failures = 0;
  for (uint64_t call = 0;; ++call) {
    faulty_.arm(Fault::kBitFlip, call);
    const auto result = rendered(faulty_, kPlainWay, {.path = kCheckpoint, .resume = true});
    if (faulty_.calls() <= call) break;
    ASSERT_FALSE(result.ok()) << "read " << call;
    EXPECT_TRUE(result.error().code == ErrorCode::kCorrupt || result.error().code == ErrorCode::kInput);
    ++failures;
  }
  EXPECT_GT(failures, 5u);
}

}  // namespace
}  // namespace shoal::testing
