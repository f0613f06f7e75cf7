// The promise that the builder is invisible: whichever built the trees, at once or in chunks, every order gives the
// bits of one picture.
#include <gtest/gtest.h>

#include <cstring>

#include "engine/build_record.h"
#include "engine/generate.h"
#include "engine/render.h"
#include "tests/engine/built_scene.h"
#include "tests/support/sample_soups.h"
#include "tests/support/temporary_folder.h"

namespace shoal::testing {
namespace {

std::string generated(const TemporaryFolder& folder, const std::string& kind, uint64_t triangles) {
  GenerateOptions options;
  options.kind = kind;
  options.triangles = triangles;
  options.out_dir = folder / kind;
  const auto report = generate_scene(posix_file_system(), options);
  EXPECT_TRUE(report.ok()) << report.error().message;
  return report.value().gltf_path;
}

SceneBuildReport build(const std::string& gltf, const std::string& output, const SceneBuildOptions& options) {
  auto report = build_scene(posix_file_system(), gltf, output, options);
  EXPECT_TRUE(report.ok()) << report.error().message;
  return report.ok() ? std::move(report).value() : SceneBuildReport{};
}

std::vector<float> picture_of(const std::string& shoal, Order order, unsigned threads = 2) {
  auto scene = open_scene(posix_file_system(), shoal, ReadMode::kBuffered, {});
  EXPECT_TRUE(scene.ok()) << scene.error().message;
  PictureOptions picture;
  picture.width = 48, picture.height = 40, picture.samples = 2;
  picture.shading.bounces = 4;
  picture.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(0.5f), {}};
  ExecutionOptions execution;
  execution.order = order;
  execution.threads = threads;
  auto result = render(posix_file_system(), scene.value(), picture, execution);
  EXPECT_TRUE(result.ok()) << result.error().message;
  return result.ok() ? std::move(result.value().rgba) : std::vector<float>{};
}

void expect_one_picture(const TemporaryFolder& folder, const std::string& gltf, uint64_t chunk_triangles) {
  const std::string plain = folder / "plain.shoal";
  build(gltf, plain, {});
  const std::vector<float> expected = picture_of(plain, Order::kDepthFirst, 1);
  double sum = 0;
  for (const float value : expected) sum += value;
  EXPECT_GT(sum, 0) << "a black picture proves nothing";
  for (const BvhBuilder builder : kBvhBuilders) {
    for (const bool in_chunks : {false, true}) {
      SCOPED_TRACE(std::string(bvh_builder_name(builder)) + (in_chunks ? ", in chunks" : ""));
      SceneBuildOptions options;
      options.builder = builder;
      options.treelet_bytes = in_chunks ? 8192 : 65536;
      if (in_chunks) options.chunk_triangles = chunk_triangles;
      const std::string shoal = folder / "other.shoal";
      const SceneBuildReport report = build(gltf, shoal, options);
      EXPECT_EQ(report.chunks_count > 0, in_chunks);
      for (const Order order : {Order::kDepthFirst, Order::kQueued, Order::kSorted, Order::kHybrid}) {
        const std::vector<float> actual = picture_of(shoal, order);
        ASSERT_EQ(actual.size(), expected.size());
        EXPECT_EQ(std::memcmp(actual.data(), expected.data(), expected.size() * sizeof(float)), 0)
            << order_name(order);
      }
    }
  }
}

TEST(BuilderOrders, AgreeOnATerrain) {
  const TemporaryFolder folder;
  expect_one_picture(folder, generated(folder, "terrain", 20000), 3000);
}

TEST(BuilderOrders, AgreeOnInstances) {
  const TemporaryFolder folder;
  expect_one_picture(folder, generated(folder, "instances", 30000), 200);
}

TEST(BuilderOrders, FilesNameTheirBuilder) {
  MemoryFileSystem fs;
  WrittenScene scene;
  const uint32_t positions = scene.add_floats(3, grid_soup(40).positions);
  scene.add_node({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", positions}}}})}});
  scene.save(fs);
  std::vector<uint64_t> keys;
  double cost[kBvhBuilders.size()];
  for (const BvhBuilder builder : kBvhBuilders) {
    SceneBuildOptions options;
    options.builder = builder;
    const BuiltScene built = build_and_open(fs, options);
    EXPECT_EQ(built.scene.header.bvh_builder, static_cast<uint32_t>(builder));
    EXPECT_EQ(built.scene.header.triangles_count, 3200u);
    const auto key = build_cache_key(fs, "scene.gltf", options);
    ASSERT_TRUE(key.ok());
    for (const uint64_t other : keys) EXPECT_NE(key.value(), other);
    keys.push_back(key.value());
    cost[static_cast<size_t>(builder)] = built.report.sah_cost;
    options.threads = 1;
    EXPECT_EQ(build_and_open(fs, options).report.sah_cost, built.report.sah_cost);
  }
  EXPECT_LT(cost[static_cast<size_t>(BvhBuilder::kSah)], cost[static_cast<size_t>(BvhBuilder::kLbvh)]);
}

}  // namespace
}  // namespace shoal::testing
