// The promise that --max-memory bounds the whole process, by the kernel's own count: build and render in a memory
// control group of exactly the cap, where one page too many is death, and of twice the cap, where the group's maximum,
// page cache included, must stay under the cap. Skipped where groups cannot be made (not root, no memory controller).
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <regex>

#include "tests/bins/program.h"
#include "tests/support/memory_group.h"
#include "tests/support/sanitized.h"

namespace shoal::testing {
namespace {

constexpr uint64_t kMiB = 1ull << 20;
constexpr const char* kTriangles = "700K";

class GroupCap : public ::testing::Test {
 protected:
  void SetUp() override {
    if (kSanitized) GTEST_SKIP() << "a sanitizer's own memory is in the group";
    const auto group = MemoryGroup::create(64 * kMiB);
    if (!group.ok()) GTEST_SKIP() << group.error().message;
    const ProgramRun made = run_shoal(folder_, {"generate", "terrain", "--triangles", kTriangles, "--out",
                                                folder_ / "terrain", "--quiet"});
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }

  std::vector<std::string> build_command() const {
    return {SHOAL_BINARY, "build", folder_ / "terrain/terrain.gltf", "-o", folder_ / "terrain.shoal", "--quiet"};
  }
  std::vector<std::string> render_command() const {
    return {SHOAL_BINARY, "render",  folder_ / "terrain.shoal", "-o",    folder_ / "out.exr", "--stats",
            folder_ / "out.json", "--quiet", "--width", "160", "--height", "96", "--spp", "1", "--bounces", "3"};
  }
  static std::vector<std::string> with_cap(std::vector<std::string> command, uint64_t cap_bytes) {
    command.push_back("--max-memory");
    command.push_back(std::to_string(cap_bytes));
    return command;
  }

  /// The smallest cap that the program says would work, and a little more, so that it can get on.
  static uint64_t small_cap(const std::vector<std::string>& command) {
    const MeasuredRun refused = run_measured(with_cap(command, kMiB));
    EXPECT_EQ(refused.exit_code, 5) << refused.output;
    std::smatch match;
    const bool named = std::regex_search(refused.output, match, std::regex("(about|needs) ([0-9]+) MiB"));
    EXPECT_TRUE(named) << refused.output;
    return named ? (std::stoull(match[2].str()) + 4) * kMiB : 0;
  }

  static void expect_holds(const std::vector<std::string>& command, uint64_t cap_bytes) {
    for (const uint64_t limit : {cap_bytes, 2 * cap_bytes}) {
      SCOPED_TRACE(command[1] + ", cap " + std::to_string(cap_bytes) + ", group " + std::to_string(limit));
      const auto group = MemoryGroup::create(limit);
      ASSERT_TRUE(group.ok()) << group.error().message;
      const MeasuredRun run = run_measured(with_cap(command, cap_bytes), &group.value());
      EXPECT_EQ(run.exit_code, 0) << "signal " << run.signal << ": " << run.output;
      EXPECT_EQ(group.value().oom_kills_count(), 0u);
      EXPECT_GT(group.value().peak_bytes(), cap_bytes / 8) << "the group saw nothing of the program";
      EXPECT_LE(group.value().peak_bytes(), cap_bytes);
    }
  }

  TemporaryFolder folder_;
};

TEST_F(GroupCap, HoldsForTheWholeProcessWhileBuilding) { expect_holds(build_command(), small_cap(build_command())); }

TEST_F(GroupCap, HoldsForTheWholeProcessWhileRendering) {
  const MeasuredRun built = run_measured(build_command());
  ASSERT_EQ(built.exit_code, 0) << built.output;
  expect_holds(render_command(), small_cap(render_command()));
  const nlohmann::json stats = nlohmann::json::parse(file_text(folder_ / "out.json"), nullptr, false);
  ASSERT_TRUE(stats.is_object());
  EXPECT_LT(stats["memory"]["cache_bytes"], stats["memory"]["scene_page_bytes"]) << "everything fits: nothing is shown";
}

TEST_F(GroupCap, AGroupKillsWhatDoesNotKeepToIt) {
  // What the two tests above lean on: without a cap of its own the same build dies in so small a group.
  const auto group = MemoryGroup::create(24 * kMiB);
  ASSERT_TRUE(group.ok());
  const MeasuredRun run = run_measured(with_cap(build_command(), 4096 * kMiB), &group.value());
  EXPECT_NE(run.exit_code, 0);
  EXPECT_GT(group.value().oom_kills_count(), 0u);
}

}  // namespace
}  // namespace shoal::testing
