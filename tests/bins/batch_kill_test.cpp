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

TEST(BatchKill, AtAnyInstantNothingIsLostAndNothingIsHalf) {
  const BatchFolder batch;
  batch.add_scene("four.glb", 4, true);
  const std::string reference = batch.folder / "reference";
  const std::vector<std::string> options = join(tiny_picture(), {"--jobs", "2", "--quiet"});
  const auto start = Clock::now();
  expect_exit(run_shoal(batch.folder, join({"batch", batch.scenes(), "--out", reference}, options)), 0);
  const auto whole = std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - start);
  const auto expected = pictures_in(reference);
  ASSERT_EQ(expected.size(), 4u);

  const std::vector<std::string> command = join({SHOAL_BINARY, "batch", batch.scenes(), "--out", batch.out()}, options);
  std::mt19937 random(2026);
  uint64_t interrupted = 0;
  for (int kill = 0; kill < kills(); ++kill) {
    SCOPED_TRACE("kill " + std::to_string(kill));
    if (kill % kKillsEachTime == 0) std::filesystem::remove_all(batch.out());
    Program program(batch.folder, command);
    std::this_thread::sleep_for(std::chrono::microseconds(random() % static_cast<uint64_t>(whole.count() + 1)));
    interrupted += program.running();
    program.send(SIGKILL);
    program.wait();
    expect_whole_files(batch.out(), reference);
    if (kill % kKillsEachTime != kKillsEachTime - 1 && kill + 1 != kills()) continue;
    // One that was killed before it was known cannot be gone on with; the command itself always can.
    const bool known = std::filesystem::exists(batch.out("/.batch/batch.json"));
    const std::vector<std::string> resume = {"batch", "--resume", "--out", batch.out(), "--quiet"};
    expect_exit(run_shoal(batch.folder, known ? resume : std::vector(command.begin() + 1, command.end())), 0);
    EXPECT_EQ(pictures_in(batch.out()), expected);
    expect_whole_files(batch.out(), reference);
    expect_no_temporaries(batch.out());
    EXPECT_EQ(batch.summary()["left_count"], 0);
    if (HasFailure()) return;
  }
  EXPECT_GT(interrupted, 0u);
}

}  // namespace
}  // namespace shoal::testing
