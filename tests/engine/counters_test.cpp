#include "engine/counters.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>

namespace shoal {
namespace {

RenderCounters balanced() {
  RenderCounters c;
  c.samples_started_count = c.samples_committed_count = 10;
  c.page_requests_count = 7, c.page_hits_count = 4, c.page_misses_count = 3;
  c.treelet_loads_count = 2, c.texture_loads_count = 1;
  RayCounters& camera = c.rays[0][0];
  camera.rays_traced_count = camera.rays_finished_count = 10;
  camera.ray_hits_count = 6, camera.ray_misses_count = 4;
  camera.rays_queued_count = camera.rays_drained_count = 21;
  c.vertices_shaded_count = 6;
  return c;
}

TEST(Counters, BalancedOnesPass) { EXPECT_TRUE(check_identities(balanced(), 10).ok()); }

TEST(Counters, EachBrokenIdentityIsFoundAndNamed) {
  const auto expect_broken = [](auto change, const char* name) {
    RenderCounters c = balanced();
    change(c);
    const Status status = check_identities(c, 10);
    ASSERT_FALSE(status.ok()) << name;
    EXPECT_EQ(status.error().code, ErrorCode::kInternal);
    EXPECT_NE(status.error().message.find(name), std::string::npos) << status.error().message;
  };
  expect_broken([](RenderCounters& c) { ++c.page_hits_count; }, "page_requests_count");
  expect_broken([](RenderCounters& c) { ++c.treelet_loads_count; }, "misses + prefetches");
  expect_broken([](RenderCounters& c) { ++c.rays[2][3].rays_queued_count; }, "rays_queued_count");
  expect_broken([](RenderCounters& c) { ++c.rays[1][1].rays_traced_count; }, "rays_traced_count");
  expect_broken([](RenderCounters& c) { --c.rays[0][0].ray_misses_count; }, "rays_finished_count");
  expect_broken([](RenderCounters& c) { --c.samples_committed_count; }, "samples_started_count");
  expect_broken([](RenderCounters& c) { ++c.vertices_shaded_count; }, "vertices_shaded_count");
}

TEST(Counters, SumsByKindAndByBounceAgreeWithTheTotal) {
  RenderCounters c = balanced();
  c.rays[1][2].node_tests_count = 5;
  c.rays[2][2].node_tests_count = 7;
  EXPECT_EQ(c.total().node_tests_count, 12u);
  EXPECT_EQ(c.of_bounce(2).node_tests_count, 12u);
  EXPECT_EQ(c.of_kind(RayKind::kShadow).node_tests_count, 7u);
  RenderCounters twice = c;
  twice.add(c);
  EXPECT_EQ(twice.total().node_tests_count, 24u);
  EXPECT_EQ(twice.samples_started_count, 20u);
}

TEST(Counters, JsonHoldsEveryListedCounterOnce) {
  const auto json = nlohmann::json::parse(counters_json(balanced()));
  std::set<std::string_view> names;
  for (const CounterInfo& info : counter_list()) {
    EXPECT_TRUE(names.insert(info.name).second) << info.name;
    EXPECT_TRUE(json["totals"].contains(std::string(info.name))) << info.name;
  }
  EXPECT_EQ(json["totals"].size(), names.size());
  EXPECT_EQ(json["by_kind"]["camera"]["rays_traced_count"], 10);
}

}  // namespace
}  // namespace shoal
