// Traffic at each level of `shoal compare`, as users read it.
#include <nlohmann/json.hpp>

#include "tests/bins/small_scene.h"

namespace shoal::testing {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

ProgramRun compare(const TemporaryFolder& folder, const std::vector<std::string>& more) {
  return run_shoal(
      folder,
      join(join({"compare", folder / "terrain.shoal", "--out", folder / "out", "--threads", "2"}, tiny_picture()),
           more));
}

json report_of(const TemporaryFolder& folder) { return json::parse(file_text(folder / "out/compare.json")); }

void expect_model(const json& stats, const std::vector<uint64_t>& sizes) {
  const json& model = stats["cache_model"];
  ASSERT_EQ(model["available"], true) << model.dump();
  ASSERT_EQ(model["levels"].size(), sizes.size());
  for (size_t i = 0; i < sizes.size(); ++i) {
    const json& level = model["levels"][i];
    EXPECT_EQ(level["size_bytes"], sizes[i]);
    EXPECT_EQ(level["shared"], i + 1 == sizes.size());
    EXPECT_GT(level["ways"], 0);
    EXPECT_GT(level["misses_count"], 0);
    EXPECT_GE(level["accesses_count"], level["misses_count"]);
    if (i > 0) {
      EXPECT_EQ(level["accesses_count"], model["levels"][i - 1]["misses_count"]);
    }
  }
  EXPECT_EQ(model["levels"][0]["name"], "L1");
  const uint64_t rays = stats["counters"]["totals"]["rays_traced_count"];
  EXPECT_EQ(model["rays_count"], rays);
  const uint64_t bytes = model["memory_read_bytes"].get<uint64_t>() + model["memory_written_bytes"].get<uint64_t>();
  EXPECT_NEAR(model["memory_bytes_per_ray"].get<double>() * static_cast<double>(rays), static_cast<double>(bytes),
              1);
  EXPECT_EQ(model["memory_read_bytes"], 64 * model["levels"].back()["misses_count"].get<uint64_t>());
  EXPECT_NEAR(model["treelet_lines_per_ray"].get<double>() * static_cast<double>(rays),
              stats["treelet_lines_touched_count"].get<double>(), 1);
  EXPECT_GT(model["treelet_lines_per_ray"], 5);
  uint64_t by_kind = 0;
  for (const auto& [kind, kind_bytes] : model["memory_bytes_by_kind"].items())
    by_kind += kind_bytes.get<uint64_t>();
  EXPECT_EQ(by_kind, bytes);
}

TEST(CompareLevels, EveryOrderHasTheTrafficOfEachLevel) {
  const TemporaryFolder folder;
  make_terrain(folder);
  const ProgramRun run =
      compare(folder, {"--orders", "queued,depth-first,sorted,hybrid,packet,packet-reorder,stream,depth-first-if-if", "--cache-levels", "16K:4,96K:12,512K:16"});
  expect_exit(run, 0);
  for (const char* row :
       {"treelet lines touched a ray", "L1 misses a ray (model)", "last level misses a ray (model)",
        "memory bytes a ray (model)", "SIMD lanes in use: treelet nodes", "rays a treelet load",
        "page bytes decoded", "treelet visits a ray"}) {
    EXPECT_THAT(run.out, HasSubstr(row));
  }
  const json report = report_of(folder);
  EXPECT_EQ(report["pictures_identical"], true);
  for (const auto& [order, stats] : report["orders"].items()) {
    SCOPED_TRACE(order);
    expect_model(stats, {16u << 10, 96u << 10, 512u << 10});
    EXPECT_EQ(stats["cache_model"]["levels_source"], "given");
    for (const auto& [kind, lanes] : stats["simd_lane_occupancy"].items()) {
      EXPECT_GT(lanes["share"], 0) << kind;
      EXPECT_LE(lanes["active_lanes_count"], lanes["offered_lanes_count"]) << kind;
    }
    EXPECT_FALSE(stats["simd_lane_occupancy"].empty());
  }
}

TEST(CompareLevels, HardwareCountersAreGivenOrSaidToBeAbsent) {
  const TemporaryFolder folder;
  make_terrain(folder);
  const ProgramRun run = compare(folder, {"--no-cache-model", "--orders", "queued"});
  expect_exit(run, 0);
  const json hardware = report_of(folder)["orders"]["queued"]["hardware_counters"];
  if (hardware["available"] == true) {
    EXPECT_THAT(run.out, HasSubstr("(hardware)"));
    EXPECT_GT(hardware.size(), 1u);
  } else {
    EXPECT_THAT(run.out, ::testing::ContainsRegex("hardware counters +absent"));
    EXPECT_NE(hardware["reason"], "");
    EXPECT_FALSE(hardware.contains("cycles_count"));
  }
}

TEST(CompareLevels, WhatIsNotModelledIsSaidToBeAbsent) {
  const TemporaryFolder folder;
  make_terrain(folder);
  const auto expect_absent = [&](const std::vector<std::string>& options, const std::string& reason) {
    const ProgramRun run = compare(folder, join({"--orders", "depth-first"}, options));
    expect_exit(run, 0);
    EXPECT_THAT(run.out, ::testing::ContainsRegex("model of the caches +absent"));
    const json stats = report_of(folder)["orders"]["depth-first"];
    EXPECT_EQ(stats["cache_model"]["available"], false);
    EXPECT_THAT(stats["cache_model"]["reason"].get<std::string>(), HasSubstr(reason));
    EXPECT_FALSE(stats.contains("treelet_lines_touched_count"));
  };
  expect_absent({"--no-cache-model"}, "not asked for");
  expect_absent({"--triangle-test", "fast"}, "--triangle-test watertight");
}

TEST(CompareLevels, ModelsTheMachinesOwnCachesUnlessOthersAreGiven) {
  const TemporaryFolder folder;
  make_terrain(folder);
  expect_exit(compare(folder, {"--orders", "queued", "--cache-sets", "4"}), 0);
  const json model = report_of(folder)["orders"]["queued"]["cache_model"];
  EXPECT_EQ(model["available"], true);
  EXPECT_NE(model["levels_source"], "given");
  EXPECT_EQ(model["sets_modelled_one_in"], 4);
}

TEST(CompareLevels, RefusesCachesThatCannotBe) {
  const TemporaryFolder folder;
  for (const char* levels : {"48K", "48K:12,", "48K:12;2M:16", "1000:3"}) {
    expect_error(compare(folder, {"--cache-levels", levels}), 2, {"--cache-levels", levels});
  }
  expect_error(compare(folder, {"--cache-levels", "48K:12", "--cache-sets", "3"}), 2, {"one in 3 sets"});
  expect_error(compare(folder, {"--cache-levels", "48K:12", "--cache-sets", "128"}), 2, {"at most 64"});
}

}  // namespace
}  // namespace shoal::testing
