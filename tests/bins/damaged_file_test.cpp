// Exit code 7: a .shoal file that is not what was written, and nothing is left under the output's name.
#include <filesystem>

#include "io/page_file.h"
#include "tests/bins/small_scene.h"

namespace shoal::testing {
namespace {

class DamagedFile : public ::testing::Test {
 protected:
  void SetUp() override {
    make_terrain(folder_, "2K");
    good_ = file_text(folder_ / "terrain.shoal");
    ASSERT_GT(good_.size(), 8192u);
  }

  /// The page of this kind with the most bytes.
  PageRecord page_of(PageKind kind) const {
    const auto file = PageFile::open(posix_file_system(), folder_ / "terrain.shoal", ReadMode::kBuffered);
    PageRecord largest{};
    if (!file.ok()) return largest;
    for (const PageRecord& record : file.value()->records()) {
      if (record.kind == kind && record.stored_bytes > largest.stored_bytes) largest = record;
    }
    return largest;
  }

  std::string put_damaged(const std::string& bytes) const {
    put_file(folder_ / "damaged.shoal", bytes);
    return folder_ / "damaged.shoal";
  }

  ProgramRun render(const std::string& scene, const std::string& order = "queued") const {
    return run_shoal(folder_, join({"render", scene, "-o", folder_ / "out.exr", "--png", folder_ / "out.png",
                                    "--stats", folder_ / "out.json", "--quiet", "--order", order},
                                   tiny_picture()));
  }

  void expect_no_output() const {
    EXPECT_THAT(folder_.names(), ::testing::ElementsAre("damaged.shoal", "terrain", "terrain.shoal"));
  }

  TemporaryFolder folder_;
  std::string good_;
};

TEST_F(DamagedFile, OneBitOfATreeletIsFoundByVerifyAndByEveryOrder) {
  const PageRecord page = page_of(PageKind::kTreelet);
  ASSERT_GT(page.stored_bytes, 0u);
  std::string bytes = good_;
  bytes[page.offset + page.stored_bytes / 2] ^= 0x10;
  const std::string scene = put_damaged(bytes);
  const std::vector<std::string> place = {"damaged.shoal", std::to_string(page.offset), "expected", "found"};
  expect_error(run_shoal(folder_, {"verify", scene}), 7, place);
  expect_error(render(scene), 7, place);
  expect_error(render(scene, "depth-first"), 7, place);
  expect_error(
      run_shoal(folder_, join({"compare", scene, "--out", folder_ / "damaged.shoal.d", "--quiet"}, tiny_picture())),
      7, place);
  EXPECT_THAT(folder_.names("damaged.shoal.d"), ::testing::IsEmpty());
  std::filesystem::remove(folder_ / "damaged.shoal.d");
  expect_no_output();
}

TEST_F(DamagedFile, OneBitOfATableIsFoundWhenTheFileIsOpened) {
  const PageRecord page = page_of(PageKind::kTable);
  ASSERT_GT(page.stored_bytes, 0u);
  std::string bytes = good_;
  bytes[page.offset] ^= 1;
  const std::string scene = put_damaged(bytes);
  for (const char* command : {"info", "verify"})
    expect_error(run_shoal(folder_, {command, scene}), 7, {"damaged.shoal"});
  expect_error(render(scene), 7, {"damaged.shoal"});
  expect_no_output();
}

TEST_F(DamagedFile, CutFilesAreRefusedAtAnyLength) {
  for (const size_t size : {size_t{8}, size_t{4096}, good_.size() / 2, good_.size() - 4096, good_.size() - 1}) {
    const std::string scene = put_damaged(good_.substr(0, size));
    for (const char* command : {"info", "verify"}) {
      expect_error(run_shoal(folder_, {command, scene}), 7, {"damaged.shoal"});
    }
    expect_error(render(scene), 7, {"damaged.shoal"});
  }
  expect_no_output();
}

TEST_F(DamagedFile, TrailingBytesAreRefused) {
  const std::string scene = put_damaged(good_ + "x");
  expect_error(run_shoal(folder_, {"verify", scene}), 7, {"damaged.shoal"});
}

TEST_F(DamagedFile, ADamagedMagicIsToldFromAFileOfAnotherKind) {
  std::string bytes = good_;
  bytes[0] ^= 1;
  expect_error(render(put_damaged(bytes)), 7, {"damaged.shoal", "offset 0"});
  expect_error(render(put_damaged(std::string(good_.size(), 'x'))), 3, {"damaged.shoal", "not a .shoal file"});
  expect_no_output();
}

TEST_F(DamagedFile, NoByteThatIsFlippedCrashesOrGoesUnnoticedByVerify) {
  uint32_t x = 12345;
  for (int i = 0; i < 24; ++i) {
    x = x * 1664525 + 1013904223;
    std::string bytes = good_;
    bytes[(uint64_t{x} * bytes.size()) >> 32] ^= static_cast<char>(1 << (x & 7));
    const ProgramRun run = run_shoal(folder_, {"verify", put_damaged(bytes)});
    EXPECT_TRUE(run.exit_code == 7 || run.exit_code == 3) << run.exit_code << " signal " << run.signal << run.err;
  }
}

}  // namespace
}  // namespace shoal::testing
