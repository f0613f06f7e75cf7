// The promise that the order is invisible: queued = depth-first = sorted to the bit, over treelet sizes, rays in
// flight, page caches, threads, policies and traversal states, on generated scenes and on real ones.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <vector>

#include "engine/build_scene.h"
#include "engine/generate.h"
#include "engine/render.h"
#include "io/page_cache.h"

namespace shoal {
namespace {

struct Variation {
  const char* name;
  uint32_t treelet_bytes = 256u << 10;
  Order order = Order::kQueued;
  unsigned threads = 2;
  uint64_t rays_in_flight = 0;
  bool smallest_cache = false;
  uint32_t more_levels = 32;
  const char* policy = "resident-first";
  uint32_t queue_capacity = 4096;
  PagingOptions paging = {};
  bool preview = false;
  uint32_t packet_rays = 64;
};

const Variation kVariations[] = {
    {.name = "queued"},
    {.name = "depth-first, two threads", .order = Order::kDepthFirst},
    {.name = "one block of rays", .threads = 1, .rays_in_flight = 64},
    {.name = "one block of rays, five threads, full", .threads = 5, .rays_in_flight = 64, .policy = "full"},
    {.name = "smallest cache", .smallest_cache = true},
    {.name = "smallest cache, depth-first", .order = Order::kDepthFirst, .threads = 3, .smallest_cache = true},
    {.name = "no traversal state", .more_levels = 0},
    {.name = "one level of state, depth-first", .order = Order::kDepthFirst, .more_levels = 1},
    {.name = "fullest", .threads = 3, .rays_in_flight = 5000, .policy = "fullest"},
    {.name = "sweep", .rays_in_flight = 5000, .policy = "sweep"},
    {.name = "full, small queues", .rays_in_flight = 20000, .policy = "full", .queue_capacity = 100},
    {.name = "treelets of 4 KiB", .treelet_bytes = 4u << 10, .rays_in_flight = 20000},
    {.name = "treelets of 4 KiB, smallest everything", .treelet_bytes = 4u << 10, .threads = 1, .rays_in_flight = 64,
     .smallest_cache = true, .more_levels = 0},
    {.name = "every page read when it is needed", .rays_in_flight = 5000, .smallest_cache = true,
     .paging = {.read_depth = 0}},
    {.name = "smallest cache, least recent leaves", .smallest_cache = true, .paging = {.eviction = "least-recent"}},
    {.name = "read by threads, three decode", .threads = 3, .smallest_cache = true,
     .paging = {.read_depth = 2, .loader_threads = 3, .backend = ReadBackend::kThreads, .eviction = "least-demand"}},
    {.name = "treelets of 4 KiB, sweep, smallest cache", .treelet_bytes = 4u << 10, .rays_in_flight = 5000,
     .smallest_cache = true, .policy = "sweep"},
    {.name = "with a preview", .preview = true},
    {.name = "with a preview, depth-first, three threads", .order = Order::kDepthFirst, .threads = 3, .preview = true},
    {.name = "with a preview, smallest everything", .treelet_bytes = 4u << 10, .threads = 3, .rays_in_flight = 64,
     .smallest_cache = true, .preview = true},
    {.name = "with a preview, one thread, full", .threads = 1, .rays_in_flight = 20000, .policy = "full",
     .queue_capacity = 100, .preview = true},
    {.name = "hybrid", .order = Order::kHybrid},
    {.name = "hybrid, one thread", .order = Order::kHybrid, .threads = 1},
    {.name = "hybrid, treelets of 4 KiB, with a preview", .treelet_bytes = 4u << 10, .order = Order::kHybrid,
     .threads = 3, .preview = true},
    {.name = "packet", .order = Order::kPacket},
    {.name = "packet, of 256, one thread", .order = Order::kPacket, .threads = 1, .packet_rays = 256},
    {.name = "packet, of 16, treelets of 4 KiB, with a preview", .treelet_bytes = 4u << 10, .order = Order::kPacket,
     .threads = 3, .preview = true, .packet_rays = 16},
    {.name = "packet-reorder", .order = Order::kPacketReorder, .threads = 3},
    {.name = "packet-reorder, of 256, treelets of 4 KiB", .treelet_bytes = 4u << 10, .order = Order::kPacketReorder,
     .packet_rays = 256},
    {.name = "stream", .order = Order::kStream, .threads = 1},
    {.name = "stream, treelets of 4 KiB, with a preview", .treelet_bytes = 4u << 10, .order = Order::kStream,
     .threads = 3, .preview = true},
    {.name = "while-while", .order = Order::kDepthFirstWhileWhile},
    {.name = "while-while, smallest cache", .order = Order::kDepthFirstWhileWhile, .threads = 3, .smallest_cache = true},
    {.name = "if-if", .order = Order::kDepthFirstIfIf, .threads = 1},
    {.name = "if-if, treelets of 4 KiB, smallest cache", .treelet_bytes = 4u << 10, .order = Order::kDepthFirstIfIf,
     .smallest_cache = true},
    {.name = "sorted", .order = Order::kSorted},
    {.name = "sorted, waves of 32 paths", .order = Order::kSorted, .threads = 1, .rays_in_flight = 64},
    {.name = "sorted, more threads than processors", .order = Order::kSorted, .threads = 3, .rays_in_flight = 5000},
    {.name = "sorted, smallest cache", .order = Order::kSorted, .threads = 3, .rays_in_flight = 1000,
     .smallest_cache = true},
    {.name = "sorted, one thread, smallest cache", .order = Order::kSorted, .threads = 1, .smallest_cache = true},
    {.name = "sorted, treelets of 4 KiB, no traversal state", .treelet_bytes = 4u << 10, .order = Order::kSorted,
     .more_levels = 0},
    {.name = "sorted, treelets of 4 KiB, smallest cache", .treelet_bytes = 4u << 10, .order = Order::kSorted,
     .smallest_cache = true},
    {.name = "sorted, with a preview", .order = Order::kSorted, .threads = 3, .rays_in_flight = 3000, .preview = true},
    {.name = "auto", .order = Order::kAuto},
    {.name = "auto, smallest cache", .order = Order::kAuto, .threads = 3, .smallest_cache = true},
    {.name = "auto, with a preview", .order = Order::kAuto, .threads = 1, .preview = true},
    {.name = "treelets of 4 MiB", .treelet_bytes = 4u << 20},
    {.name = "treelets of 64 KiB, depth-first", .treelet_bytes = 64u << 10, .order = Order::kDepthFirst},
};

class RenderOrders : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("shoal-orders-" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override {
    std::error_code code;
    std::filesystem::remove_all(folder_, code);
  }

  std::string generated(const std::string& kind, uint64_t triangles) {
    GenerateOptions options;
    options.kind = kind;
    options.triangles = triangles;
    options.out_dir = (folder_ / kind).string();
    const auto report = generate_scene(posix_file_system(), options);
    EXPECT_TRUE(report.ok()) << report.error().message;
    return report.value().gltf_path;
  }

  std::vector<float> render_variation(const std::string& gltf, const PictureOptions& picture, const Variation& v) {
    FileSystem& fs = posix_file_system();
    const std::string shoal = (folder_ / ("scene-" + std::to_string(v.treelet_bytes) + ".shoal")).string();
    if (!std::filesystem::exists(shoal)) {
      SceneBuildOptions build;
      build.treelet_bytes = v.treelet_bytes;
      const auto built = build_scene(fs, gltf, shoal, build);
      EXPECT_TRUE(built.ok()) << built.error().message;
    }
    const ReadMode mode = v.smallest_cache ? ReadMode::kDirect : ReadMode::kBuffered;
    const auto scene = open_scene(fs, shoal, mode, {v.more_levels});
    EXPECT_TRUE(scene.ok()) << scene.error().message;
    ExecutionOptions execution;
    execution.order = v.order;
    execution.threads = v.threads;
    execution.rays_in_flight = v.rays_in_flight;
    execution.policy = v.policy;
    execution.packet_rays = v.packet_rays;
    execution.policy_options.queue_capacity = v.queue_capacity;
    execution.paging = v.paging;
    if (v.smallest_cache) {
      execution.page_cache_bytes = PageCache::minimum_capacity_bytes(*scene.value().file, v.threads);
    }
    if (v.preview) execution.preview.path = (folder_ / "preview.png").string();
    const auto result = render(fs, scene.value(), picture, execution);
    EXPECT_TRUE(result.ok()) << v.name << ": " << result.error().message;
    if (result.ok()) {
      EXPECT_EQ(result.value().first_picture.has_value(), v.preview) << v.name;
      EXPECT_EQ(result.value().previews_count > 0, v.preview) << v.name;
      EXPECT_EQ(std::filesystem::remove(folder_ / "preview.png"), v.preview) << v.name;
    }
    return result.ok() ? result.value().rgba : std::vector<float>{};
  }

  /// Every variation, or one in `step`, gives the bits of depth-first on one thread.
  void expect_one_picture(const std::string& gltf, const PictureOptions& picture, size_t step = 1) {
    const Variation plain{.name = "depth-first, one thread", .order = Order::kDepthFirst, .threads = 1};
    const std::vector<float> expected = render_variation(gltf, picture, plain);
    double sum = 0;
    for (const float value : expected) sum += value;
    EXPECT_GT(sum, 0) << "a black picture proves nothing";
    for (size_t i = 0; i < std::size(kVariations); i += step) {
      const Variation& variation = kVariations[i];
      const std::vector<float> actual = render_variation(gltf, picture, variation);
      ASSERT_EQ(actual.size(), expected.size()) << variation.name;
      EXPECT_EQ(std::memcmp(actual.data(), expected.data(), expected.size() * sizeof(float)), 0)
          << variation.name << " gives another picture";
    }
  }

  static PictureOptions small_picture(float sky) {
    PictureOptions picture;
    picture.width = 48, picture.height = 40, picture.samples = 3;
    picture.shading.bounces = 6;
    picture.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(sky), {}};
    return picture;
  }

  /// Skips the test without real scenes.
  std::string real(const std::string& path) {
    const char* data = std::getenv("SHOAL_DATA");
    return data == nullptr ? std::string() : std::string(data) + "/scenes/" + path;
  }

  std::filesystem::path folder_;
};

TEST_F(RenderOrders, AgreeOnTerrain) { expect_one_picture(generated("terrain", 60000), small_picture(0)); }

TEST_F(RenderOrders, AgreeByEveryTriangleTest) {
  for (const TriangleTest test : {TriangleTest::kFast, TriangleTest::kDouble}) {
    PictureOptions picture = small_picture(0.5f);
    picture.shading.triangle_test = test;
    expect_one_picture(generated("instances", 30000), picture);
  }
}

TEST_F(RenderOrders, AgreeOnInstancesWithCoverage) {
  expect_one_picture(generated("instances", 300000), small_picture(0.5f));
}

TEST_F(RenderOrders, AgreeWithEverySampler) {
  for (const SamplerKind sampler : {SamplerKind::kSobol, SamplerKind::kBlueNoise}) {
    PictureOptions picture = small_picture(0.5f);
    picture.shading.sampler = sampler;
    expect_one_picture(generated("instances", 100000), picture, 5);
  }
}

TEST_F(RenderOrders, AgreeOnTheDemo) { expect_one_picture(generated("demo", 100000), small_picture(0)); }

#define SHOAL_REAL_SCENE_TEST(name, path, sky)                                              \
  TEST_F(RenderOrders, AgreeOn##name) {                                                     \
    if (real(path).empty()) GTEST_SKIP() << "SHOAL_DATA is not set: no real scenes";        \
    expect_one_picture(real(path), small_picture(sky));                                     \
  }
SHOAL_REAL_SCENE_TEST(Coffee, "coffee/coffee.gltf", 0)
SHOAL_REAL_SCENE_TEST(Lamp, "lamp/lamp.gltf", 0)
SHOAL_REAL_SCENE_TEST(Helmet, "helmet/helmet.gltf", 1)
SHOAL_REAL_SCENE_TEST(Kitchen, "kitchen/kitchen.gltf", 0)

TEST_F(RenderOrders, ASampleOfTilesHasThePixelsOfTheWholePicture) {
  const std::string gltf = generated("terrain", 20000);
  PictureOptions picture = small_picture(0);
  picture.width = 160, picture.height = 96;
  const std::vector<float> whole = render_variation(gltf, picture, {.name = "whole"});
  picture.tile_sample = 4;
  const std::vector<float> sample = render_variation(gltf, picture, {.name = "one in four"});
  const std::vector<float> depth_first =
      render_variation(gltf, picture, {.name = "one in four, depth-first", .order = Order::kDepthFirst});
  EXPECT_EQ(sample, render_variation(gltf, picture, {.name = "one in four, with a preview", .preview = true}));
  ASSERT_EQ(whole.size(), sample.size());
  EXPECT_EQ(sample, depth_first);
  size_t lit = 0, black = 0;
  for (size_t i = 0; i < whole.size(); i += 4) {
    const bool same = std::memcmp(&whole[i], &sample[i], 4 * sizeof(float)) == 0;
    lit += sample[i] > 0 ? 1 : 0;
    if (sample[i] == 0 && sample[i + 1] == 0 && sample[i + 2] == 0) ++black;
    EXPECT_TRUE(same || (sample[i] == 0 && sample[i + 3] == 0)) << "pixel " << i / 4;
  }
  EXPECT_GT(lit, 160u * 96 / 8);
  EXPECT_GT(black, 160u * 96 / 2);
}

TEST_F(RenderOrders, CountEveryRayOfAScene) {
  // A render whose counters do not balance fails, so what is left to show is that they count this scene's rays.
  const std::string gltf = generated("terrain", 100000);
  const std::string shoal = (folder_ / "count.shoal").string();
  ASSERT_TRUE(build_scene(posix_file_system(), gltf, shoal, {}).ok());
  const auto scene = open_scene(posix_file_system(), shoal, ReadMode::kBuffered, {});
  ASSERT_TRUE(scene.ok());
  const PictureOptions picture = small_picture(0);
  std::vector<RayCounters> totals;
  for (const Order order : {Order::kQueued, Order::kDepthFirst, Order::kSorted}) {
    ExecutionOptions execution;
    execution.order = order;
    execution.threads = 2;
    const auto result = render(posix_file_system(), scene.value(), picture, execution);
    ASSERT_TRUE(result.ok()) << result.error().message;
    EXPECT_EQ(result.value().order.order, order);
    totals.push_back(result.value().counters.total());
    EXPECT_EQ(result.value().counters.of_kind(RayKind::kCamera).rays_traced_count, 48u * 40 * 3);
    EXPECT_GT(result.value().counters.of_kind(RayKind::kShadow).rays_traced_count, 0u);
    EXPECT_EQ(result.value().counters.ray_moved_bytes > 0, order != Order::kDepthFirst);
  }
  for (const RayCounters& total : totals) {
    EXPECT_EQ(total.rays_traced_count, totals[0].rays_traced_count);
    EXPECT_EQ(total.ray_hits_count, totals[0].ray_hits_count);
    EXPECT_EQ(total.node_tests_count, totals[0].node_tests_count);
    EXPECT_EQ(total.triangle_tests_count, totals[0].triangle_tests_count) << "trials count on it";
  }
  ExecutionOptions execution;
  execution.order = Order::kHybrid;
  const auto result = render(posix_file_system(), scene.value(), picture, execution);
  ASSERT_TRUE(result.ok()) << result.error().message;
  const RayCounters hybrid = result.value().counters.total();
  EXPECT_EQ(hybrid.rays_traced_count, totals[0].rays_traced_count);
  EXPECT_EQ(hybrid.ray_hits_count, totals[0].ray_hits_count);
  EXPECT_LT(hybrid.node_tests_count, totals[0].node_tests_count) << "no node is met twice";
  EXPECT_NEAR(static_cast<double>(hybrid.triangle_tests_count) / static_cast<double>(totals[0].triangle_tests_count), 1,
              0.2) << "trials count on it";
  for (const Order order : {Order::kPacket, Order::kPacketReorder, Order::kStream, Order::kDepthFirstWhileWhile,
                            Order::kDepthFirstIfIf}) {
    execution.order = order;
    const auto other = render(posix_file_system(), scene.value(), picture, execution);
    ASSERT_TRUE(other.ok()) << other.error().message;
    const RenderCounters& counted = other.value().counters;
    EXPECT_EQ(counted.total().rays_traced_count, totals[0].rays_traced_count);
    EXPECT_EQ(counted.total().ray_hits_count, totals[0].ray_hits_count);
    EXPECT_LT(counted.simd_active_lanes_count, counted.simd_lanes_count) << order_name(order);
    EXPECT_GT(counted.simd_active_lanes_count, 0u) << order_name(order);
    if (!is_depth_first(order)) continue;
    EXPECT_EQ(counted.total().node_tests_count, totals[1].node_tests_count) << "the same steps in another turn";
    EXPECT_EQ(counted.total().triangle_tests_count, totals[1].triangle_tests_count);
  }
  EXPECT_GT(totals[0].rays_queued_count, totals[0].rays_traced_count / 2);
  EXPECT_EQ(totals[1].rays_queued_count, 0u);
  EXPECT_EQ(totals[2].rays_queued_count, 0u);
}

TEST_F(RenderOrders, ARenderThatIsLongEnoughTriesTheOrders) {
  const std::string gltf = generated("terrain", 5000);
  const std::string shoal = (folder_ / "tried.shoal").string();
  ASSERT_TRUE(build_scene(posix_file_system(), gltf, shoal, {}).ok());
  const auto scene = open_scene(posix_file_system(), shoal, ReadMode::kBuffered, {});
  ASSERT_TRUE(scene.ok());
  PictureOptions picture = small_picture(1);
  picture.width = picture.height = 128, picture.samples = 64;  // the fewest that are tried: 2^20
  picture.shading.bounces = 0;
  ExecutionOptions execution;
  execution.order = Order::kDepthFirst;
  execution.threads = 2;
  execution.rays_in_flight = 20000;
  const auto expected = render(posix_file_system(), scene.value(), picture, execution);
  ASSERT_TRUE(expected.ok());
  execution.order = Order::kAuto;
  for (const bool preview : {false, true}) {
    execution.preview.path = preview ? (folder_ / "preview.png").string() : "";
    uint32_t choices = 0;
    RenderHooks hooks;
    hooks.chosen = [&](const ChosenOrder&) { ++choices; };
    const auto result = render(posix_file_system(), scene.value(), picture, execution, hooks);
    ASSERT_TRUE(result.ok()) << result.error().message;
    EXPECT_EQ(choices, 1u);
    EXPECT_NE(result.value().order.order, Order::kAuto);
    EXPECT_TRUE(result.value().order.reason.starts_with("tried")) << result.value().order.reason;
    EXPECT_EQ(result.value().rgba, expected.value().rgba);
    EXPECT_EQ(result.value().counters.total().rays_traced_count, expected.value().counters.total().rays_traced_count);
    EXPECT_EQ(result.value().counters.total().ray_hits_count, expected.value().counters.total().ray_hits_count);
  }
}

}  // namespace
}  // namespace shoal
