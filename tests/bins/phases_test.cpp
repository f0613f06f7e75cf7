// Where the time of a render goes, as users read it: --stats, compare.json and the table.
#include <algorithm>
#include <nlohmann/json.hpp>

#include "tests/bins/small_scene.h"

namespace shoal::testing {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

const std::vector<std::string> kPhases = {"traversal", "top_tree",   "queue", "shading",   "paths",
                                          "paging",    "scheduling", "idle",  "reporting", "setup"};

/// Phases exclude each other and leave nothing out.
void expect_whole(const json& stats) {
  const double whole = stats["threads_count"].get<double>() * stats["render_seconds"].get<double>();
  const json& phases = stats["phases"];
  double seconds = 0, shares = 0;
  ASSERT_EQ(phases["seconds"].size(), kPhases.size());
  for (const std::string& name : kPhases) {
    ASSERT_TRUE(phases["seconds"].contains(name) && phases["shares"].contains(name)) << name;
    EXPECT_FALSE(phases["meanings"][name].get<std::string>().empty()) << name;
    const double value = phases["seconds"][name], share = phases["shares"][name];
    EXPECT_GE(value, 0) << name;
    EXPECT_NEAR(share, value / whole, 0.01) << name;
    seconds += value, shares += share;
  }
  EXPECT_NEAR(seconds, whole, 0.01 * whole);
  EXPECT_NEAR(shares, 1, 1e-9);
  EXPECT_NEAR(phases["thread_seconds"].get<double>(), seconds, 1e-9);
  EXPECT_NEAR(phases["routing_share"].get<double>(),
              phases["shares"]["top_tree"].get<double>() + phases["shares"]["queue"].get<double>(), 1e-9);
}

void expect_phases(const json& stats, const std::vector<std::string>& some, const std::vector<std::string>& none) {
  for (const std::string& name : some) EXPECT_GT(stats["phases"]["seconds"][name].get<double>(), 0) << name;
  for (const std::string& name : none) EXPECT_EQ(stats["phases"]["seconds"][name].get<double>(), 0) << name;
}

TEST(Phases, SumToTheTimeOfAllThreadsInEveryOrder) {
  const TemporaryFolder folder;
  make_terrain(folder);
  const ProgramRun run = run_shoal(
      folder, join({"compare", folder / "terrain.shoal", "--orders", "queued,depth-first,sorted", "--out",
                    folder / "out", "--runs", "3", "--threads", "3", "--progress", "none"},
                   tiny_picture()));
  expect_exit(run, 0);
  for (const char* row : {"time in routing", "time in traversal", "time in top_tree", "time in shading"}) {
    EXPECT_THAT(run.out, HasSubstr(row));
  }
  const json report = json::parse(file_text(folder / "out/compare.json"));
  EXPECT_EQ(report["runs_count"], 3);
  ASSERT_EQ(report["orders"].size(), 3u);
  for (const auto& [order, stats] : report["orders"].items()) {
    SCOPED_TRACE(order);
    expect_whole(stats);
    expect_phases(stats, {"traversal", "top_tree", "shading", "paths", "paging", "reporting", "setup"}, {});
    std::vector<double> seconds = stats["run_seconds"];
    ASSERT_EQ(seconds.size(), 3u);
    std::sort(seconds.begin(), seconds.end());
    EXPECT_EQ(stats["render_seconds"], seconds[1]) << "what is shown is the run of median time";
  }
  expect_phases(report["orders"]["queued"], {"queue", "scheduling"}, {});
  expect_phases(report["orders"]["depth-first"], {}, {"queue", "scheduling"});
  expect_phases(report["orders"]["sorted"], {"queue"}, {"scheduling"});
}

TEST(Phases, SumToTheTimeOfAllThreadsWithAPreviewAndLittleMemory) {
  const TemporaryFolder folder;
  make_terrain(folder);
  const ProgramRun run = run_shoal(
      folder, join({"render", folder / "terrain.shoal", "-o", folder / "out.exr", "--preview", folder / "out.png",
                    "--stats", folder / "out.json", "--page-cache", "2M", "--rays-in-flight", "64", "--threads", "2", "--order", "queued"},
                   tiny_picture()));
  expect_exit(run, 0);
  const json stats = json::parse(file_text(folder / "out.json"));
  expect_whole(stats);
  expect_phases(stats, {"traversal", "queue", "paging", "reporting"}, {});
}

}  // namespace
}  // namespace shoal::testing
