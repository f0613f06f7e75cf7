// A batch that is killed at any instant, and again: nothing half-written stands under a final name, and the next one
// finishes to the same bits. SHOAL_BATCH_KILLS=200 for a long run.
#include <signal.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <thread>

#include "tests/bins/batch_folder.h"

namespace shoal::testing {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kKills = 20;
constexpr int kKillsEachTime = 2;  ///< of one batch, before it may finish

int kills() {
  const char* text = std::getenv("SHOAL_BATCH_KILLS");
  return text == nullptr ? kKills : std::max(std::atoi(text), 1);
}

class BatchKill : public ::testing::Test {
 protected:
  /// Kills a batch with these options so many times, kKillsEachTime times before it may finish.
  void soak(const std::vector<std::string>& picture, int kills) {
    const std::vector<std::string> options = join(picture, {"--jobs", "2", "--quiet"});
    batch_.add_scene("four.glb", 4, true);
    const std::string reference = batch_.folder / "reference";
    const auto start = Clock::now();
    expect_exit(run_shoal(batch_.folder, join({"batch", batch_.scenes(), "--out", reference}, options)), 0);
    const auto whole = std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - start);
    const auto expected = pictures_in(reference);
    ASSERT_EQ(expected.size(), 4u);
    const std::vector<std::string> words = join({"batch", batch_.scenes(), "--out", batch_.out()}, options);
    std::mt19937 random(2026);
    for (int kill = 0; kill < kills && !HasFailure(); ++kill) {
      SCOPED_TRACE("kill " + std::to_string(kill));
      if (kill % kKillsEachTime == 0) std::filesystem::remove_all(batch_.out());
      Program program(batch_.folder, join({SHOAL_BINARY}, words));
      std::this_thread::sleep_for(std::chrono::microseconds(random() % static_cast<uint64_t>(whole.count() + 1)));
      interrupted_ += program.running();
      program.send(SIGKILL);
      program.wait();
      expect_whole_files(batch_.out(), reference);
      const bool last = kill % kKillsEachTime == kKillsEachTime - 1 || kill + 1 == kills;
      if (last) expect_the_rest(words, expected, reference);
    }
    EXPECT_GT(interrupted_, 0u);
  }

  uint64_t interrupted_ = 0, checkpoints_ = 0;

 private:
  void expect_the_rest(const std::vector<std::string>& words, const std::map<std::string, std::string>& expected,
                       const std::string& reference) {
    for (const std::string& file : batch_.outputs()) checkpoints_ += file.ends_with(".checkpoint") ? 1 : 0;
    // One that was killed before it was known cannot be gone on with; the command itself always can.
    const bool known = std::filesystem::exists(batch_.out("/.batch/batch.json"));
    const std::vector<std::string> resume = {"batch", "--resume", "--out", batch_.out(), "--quiet"};
    expect_exit(run_shoal(batch_.folder, known ? resume : words), 0);
    EXPECT_EQ(pictures_in(batch_.out()), expected);
    expect_whole_files(batch_.out(), reference);
    expect_no_temporaries(batch_.out());
    EXPECT_EQ(batch_.summary()["left_count"], 0);
    for (const std::string& file : batch_.outputs()) EXPECT_FALSE(file.ends_with(".checkpoint")) << file;
  }

  BatchFolder batch_;
};

TEST_F(BatchKill, AtAnyInstantNothingIsLostAndNothingIsHalf) { soak(tiny_picture(), kills()); }

TEST_F(BatchKill, WithinPicturesTheNextOneGoesOnFromTheirCheckpoints) {
  soak({"--width", "48", "--height", "32", "--spp", "64", "--checkpoint", "every=0.005"}, kills());
  EXPECT_GT(checkpoints_, 0u) << "that were gone on from, of " << interrupted_ << " kills";
}

}  // namespace
}  // namespace shoal::testing
