// What a modelled run tells: the same picture and the same tests as a run that nobody measures, in every order.
#include "engine/touch_recorder.h"

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>

#include "engine/build_scene.h"
#include "engine/generate.h"
#include "engine/render.h"
#include "tests/support/temporary_folder.h"

namespace shoal {
namespace {

constexpr Order kOrders[] = {Order::kDepthFirst, Order::kSorted,         Order::kQueued,
                             Order::kHybrid,     Order::kPacket,         Order::kPacketReorder,
                             Order::kStream,     Order::kDepthFirstIfIf, Order::kDepthFirstWhileWhile};

CacheModel::Options small_caches() {
  return {
      .levels = {{.bytes = 8u << 10, .ways = 8}, {.bytes = 64u << 10, .ways = 8}, {.bytes = 3u << 18, .ways = 12}}};
}

class TouchRecorderTest : public ::testing::Test {
 protected:
  const Scene& scene(const std::string& kind) {
    GenerateOptions options;
    options.kind = kind;
    options.triangles = 30000;
    options.out_dir = folder_ / kind;
    const auto generated = generate_scene(posix_file_system(), options);
    EXPECT_TRUE(generated.ok()) << generated.error().message;
    SceneBuildOptions build;
    build.treelet_bytes = 32u << 10;
    const std::string path = folder_ / (kind + ".shoal");
    const auto built = build_scene(posix_file_system(), generated.value().gltf_path, path, build);
    EXPECT_TRUE(built.ok()) << built.error().message;
    auto opened = open_scene(posix_file_system(), path, ReadMode::kBuffered, {});
    EXPECT_TRUE(opened.ok()) << opened.error().message;
    scene_.emplace(std::move(opened).value());
    return *scene_;
  }

  static RenderResult render_with(const Scene& scene, Order order, unsigned threads, TouchRecorder* recorder) {
    PictureOptions picture;
    picture.width = 24, picture.height = 24, picture.samples = 2;
    picture.shading.bounces = 3;
    picture.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(0.5f), {}};
    ExecutionOptions execution;
    execution.order = order;
    execution.threads = threads;
    execution.touches = recorder;
    auto result = render(posix_file_system(), scene, picture, execution);
    EXPECT_TRUE(result.ok()) << result.error().message;
    return std::move(result).value();
  }

  testing::TemporaryFolder folder_;
  std::optional<Scene> scene_;
};

TEST_F(TouchRecorderTest, PicturesAndTestsAreThoseOfARunThatNobodyMeasures) {
  for (const char* kind : {"terrain", "instances"}) {
    const Scene& scene = this->scene(kind);
    for (const Order order : kOrders) {
      for (const unsigned threads : {1u, 3u}) {
        SCOPED_TRACE(std::string(kind) + ", " + std::string(order_name(order)) + ", " + std::to_string(threads));
        const RenderResult plain = render_with(scene, order, threads, nullptr);
        TouchRecorder recorder(small_caches());
        const RenderResult told = render_with(scene, order, threads, &recorder);
        ASSERT_EQ(plain.rgba.size(), told.rgba.size());
        EXPECT_EQ(std::memcmp(plain.rgba.data(), told.rgba.data(), plain.rgba.size() * sizeof(float)), 0);
        if (threads > 1) continue;  // who meets whom changes how far a ray looks
        EXPECT_EQ(plain.counters.total().node_tests_count, told.counters.total().node_tests_count);
        EXPECT_EQ(plain.counters.total().triangle_tests_count, told.counters.total().triangle_tests_count);
        EXPECT_EQ(plain.counters.simd_lanes_count, told.counters.simd_lanes_count);
        EXPECT_EQ(plain.counters.simd_active_lanes_count, told.counters.simd_active_lanes_count);
        EXPECT_EQ(plain.counters.treelet_visits_count, told.counters.treelet_visits_count);
      }
    }
  }
}

TEST_F(TouchRecorderTest, TellsEveryNodeAndEveryLeafThatIsTested) {
  for (const char* kind : {"terrain", "instances"}) {
    const Scene& scene = this->scene(kind);
    for (const Order order : {Order::kDepthFirst, Order::kSorted, Order::kQueued, Order::kStream}) {
      SCOPED_TRACE(std::string(kind) + ", " + std::string(order_name(order)));
      TouchRecorder recorder(small_caches());
      const RayCounters rays = render_with(scene, order, 2, &recorder).counters.total();
      const TouchReport report = recorder.report();
      EXPECT_EQ((report.lanes.top_nodes.offered + report.lanes.nodes.offered) / 8, rays.node_tests_count);
      EXPECT_EQ(report.lanes.leaves.active, rays.triangle_tests_count);
      EXPECT_GT(report.lanes.nodes.share(), 0.3);
      EXPECT_LE(report.lanes.leaves.share(), 1.0);
      EXPECT_GT(report.treelet_lines, 2 * report.lanes.nodes.offered / 8);  // and leaves
      EXPECT_EQ(report.lanes.packets.offered, 0u);
    }
  }
}

TEST_F(TouchRecorderTest, TellsEveryLeafThatPacketsTest) {
  for (const char* kind : {"terrain", "instances"}) {
    const Scene& scene = this->scene(kind);
    for (const Order order : {Order::kPacket, Order::kPacketReorder}) {
      SCOPED_TRACE(std::string(kind) + ", " + std::string(order_name(order)));
      TouchRecorder recorder(small_caches());
      const RayCounters rays = render_with(scene, order, 2, &recorder).counters.total();
      const TouchReport report = recorder.report();
      EXPECT_EQ(report.lanes.leaves.active, rays.triangle_tests_count);
      EXPECT_GT(report.lanes.packets.active, 0u);
      EXPECT_LE(report.lanes.packets.share(), 1.0);
      const auto fills = [&](TouchKind of) { return report.by_kind[static_cast<size_t>(of)].fills; };
      EXPECT_GT(fills(TouchKind::kNodes) + fills(TouchKind::kPages), 0u);
      EXPECT_GT(fills(TouchKind::kTopTree), 0u);
      EXPECT_GT(report.treelet_lines, report.lanes.leaves.offered / 16 + rays.rays_traced_count);
    }
  }
}

TEST_F(TouchRecorderTest, InnerLoopsTouchTheLinesOfTreeletsThatDepthFirstTouches) {
  const Scene& scene = this->scene("terrain");
  TouchRecorder plain(small_caches());
  const RayCounters rays = render_with(scene, Order::kDepthFirst, 1, &plain).counters.total();
  const uint64_t lines = plain.report().treelet_lines;
  for (const Order order : {Order::kDepthFirstWhileWhile, Order::kDepthFirstIfIf}) {
    TouchRecorder recorder(small_caches());
    EXPECT_EQ(render_with(scene, order, 1, &recorder).counters.total().node_tests_count, rays.node_tests_count);
    EXPECT_EQ(recorder.report().treelet_lines, lines);
  }
}

TEST_F(TouchRecorderTest, EachLevelIsAskedForWhatTheOneInFrontLacks) {
  const Scene& scene = this->scene("terrain");
  for (const Order order : kOrders) {
    SCOPED_TRACE(order_name(order));
    TouchRecorder recorder(small_caches());
    render_with(scene, order, 2, &recorder);
    const TouchReport report = recorder.report();
    ASSERT_EQ(report.levels.size(), 3u);
    EXPECT_GT(report.levels[0].accesses, report.levels[0].misses);
    for (size_t i = 1; i < 3; ++i) {
      EXPECT_EQ(report.levels[i].accesses, report.levels[i - 1].misses);
      EXPECT_LT(report.levels[i].misses, report.levels[i].accesses);
    }
    EXPECT_EQ(report.memory.fills, report.levels[2].misses);
    EXPECT_EQ(report.memory.write_backs, report.levels[2].write_backs);
    LineCounts sum;
    for (const LineCounts& kind : report.by_kind) sum.fills += kind.fills, sum.write_backs += kind.write_backs;
    EXPECT_EQ(sum.fills, report.memory.fills);
    EXPECT_EQ(sum.write_backs, report.memory.write_backs);
    const auto fills = [&](TouchKind kind) { return report.by_kind[static_cast<size_t>(kind)].fills; };
    EXPECT_GT(fills(TouchKind::kTopTree), 0u);
    EXPECT_GT(fills(TouchKind::kPathStates), 0u);
    // Where a thread decodes pages itself, their nodes and leaves may be in its caches from then on.
    EXPECT_GT(fills(TouchKind::kNodes) + fills(TouchKind::kPages), 0u);
    EXPECT_GT(fills(TouchKind::kLeaves) + fills(TouchKind::kPages), 0u);
    const bool sorts = order == Order::kSorted;
    EXPECT_EQ(report.by_kind[static_cast<size_t>(TouchKind::kSorting)].fills > 0, sorts);
  }
}

TEST_F(TouchRecorderTest, ASampleOfSetsIsNearAllSets) {
  const Scene& scene = this->scene("terrain");
  uint64_t fills[2];
  for (const uint32_t one_in : {1u, 4u}) {
    CacheModel::Options options = small_caches();
    options.levels.pop_back();  // two levels: 64 KiB are too few for the terrain
    options.one_in = one_in;
    TouchRecorder recorder(options);
    render_with(scene, Order::kDepthFirst, 1, &recorder);
    fills[one_in == 1 ? 0 : 1] = recorder.report().memory.fills;
  }
  const auto all = static_cast<double>(fills[0]);
  EXPECT_NEAR(static_cast<double>(fills[1]), all, 0.2 * all);
}

}  // namespace
}  // namespace shoal
