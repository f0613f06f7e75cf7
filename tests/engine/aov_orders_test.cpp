// Layers beside the colour have the same bits in every order, with any threads, caches and rays in flight; the map of
// bytes says what was loaded, whoever loaded it.
#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <numeric>

#include "engine/build_scene.h"
#include "engine/generate.h"
#include "engine/render.h"
#include "tests/support/render_variation.h"
#include "tests/support/same_bits.h"
#include "tests/support/temporary_folder.h"

namespace shoal::testing {
namespace {

const RenderVariation kVariations[] = {
    {.name = "depth-first, smallest cache", .order = Order::kDepthFirst, .threads = 3, .smallest_cache = true},
    {.name = "queued", .threads = 3},
    {.name = "queued, one block of rays", .threads = 1, .rays_in_flight = 64},
    {.name = "queued, smallest cache", .rays_in_flight = 2000, .smallest_cache = true},
    {.name = "sorted", .order = Order::kSorted, .threads = 3},
    {.name = "sorted, small waves, smallest cache", .order = Order::kSorted, .rays_in_flight = 1000,
     .smallest_cache = true},
    {.name = "hybrid", .order = Order::kHybrid, .threads = 3},
    {.name = "sorted, with a preview", .order = Order::kSorted, .preview = true},
};

class AovOrders : public ::testing::Test {
 protected:
  void build(const std::string& kind, uint64_t triangles) {
    GenerateOptions options;
    options.kind = kind;
    options.triangles = triangles;
    options.out_dir = folder_ / kind;
    const auto report = generate_scene(posix_file_system(), options);
    ASSERT_TRUE(report.ok()) << report.error().message;
    SceneBuildOptions build;
    build.treelet_bytes = 8u << 10;
    ASSERT_TRUE(build_scene(posix_file_system(), report.value().gltf_path, folder_ / "scene.shoal", build).ok());
    picture_.width = 48, picture_.height = 40, picture_.samples = 3;
    picture_.shading.bounces = 6;
    picture_.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(0.5f), {}};
  }

  RenderResult rendered(const char* aovs, const RenderVariation& v) {
    picture_.aovs = parse_aovs(aovs).value();
    return render_variation(folder_, picture_, v);
  }

  static const ExrChannel& layer(const RenderResult& result, const std::string& name) {
    for (const ExrChannel& channel : result.layers) {
      if (channel.name == name) return channel;
    }
    throw std::runtime_error("no layer " + name);
  }
  static double sum(const ExrChannel& channel) {
    return std::accumulate(channel.values.begin(), channel.values.end(), 0.0);
  }

  /// Every layer but that of bytes has the bits of depth-first on one thread.
  void expect_one_picture() {
    const RenderVariation plain{.name = "", .order = Order::kDepthFirst, .threads = 1};
    const RenderResult bare = rendered("", plain), expected = rendered("all", plain);
    EXPECT_EQ(bare.rgba, expected.rgba) << "the colour does not depend on layers";
    for (const ExrChannel& channel : expected.layers) {
      double content = sum(channel);
      for (const uint32_t integer : channel.integers) content += integer;
      EXPECT_NE(content, 0) << channel.name << ": an empty layer proves nothing";
    }
    for (const RenderVariation& v : kVariations) {
      const RenderResult actual = rendered("all", v);
      EXPECT_EQ(actual.rgba, expected.rgba) << v.name;
      ASSERT_EQ(actual.layers.size(), expected.layers.size());
      for (size_t i = 0; i < expected.layers.size(); ++i) {
        const ExrChannel &a = actual.layers[i], &b = expected.layers[i];
        if (b.name == "bytes.Y" || (b.name == "treelets.Y" && v.order == Order::kHybrid)) continue;
        EXPECT_EQ(a.integers, b.integers) << v.name << ", " << b.name;
        EXPECT_TRUE(same_bits(a.values, b.values)) << v.name << ", " << b.name;
      }
      EXPECT_EQ(sum(layer(actual, "treelets.Y")), static_cast<double>(actual.counters.treelet_visits_count)) << v.name;
      const double charged = sum(layer(actual, "bytes.Y")), loaded = static_cast<double>(actual.counters.decoded_bytes);
      EXPECT_GT(charged, 0) << v.name;
      if (actual.counters.page_prefetches_count == 0) {
        EXPECT_NEAR(charged, loaded, 1e-6 * loaded) << v.name;
      } else {
        EXPECT_LE(charged, loaded * (1 + 1e-6)) << v.name << ": pages read ahead for nothing are charged to nobody";
        EXPECT_GT(charged, loaded / 2) << v.name;
      }
    }
  }

  TemporaryFolder folder_;
  PictureOptions picture_;
};

TEST_F(AovOrders, AgreeOnTheDemo) {
  build("demo", 60000);
  expect_one_picture();
}

TEST_F(AovOrders, AgreeOnInstances) {
  build("instances", 100000);
  expect_one_picture();
}

TEST_F(AovOrders, OneLayerIsThatOfAll) {
  build("terrain", 5000);
  const RenderVariation plain{.name = "", .order = Order::kDepthFirst, .threads = 1};
  const RenderResult all = rendered("all", plain);
  for (const std::string& name : aov_names(parse_aovs("all").value())) {
    const RenderResult one = rendered(name.c_str(), plain);
    const Aov aov = Aov(std::countr_zero(picture_.aovs.bits));
    EXPECT_EQ(one.layers.size(), aov_info(aov).channels.size());
    for (const ExrChannel& channel : one.layers) {
      EXPECT_EQ(channel.values, layer(all, channel.name).values) << channel.name;
      EXPECT_EQ(channel.integers, layer(all, channel.name).integers) << channel.name;
    }
    EXPECT_EQ(one.rgba, all.rgba) << name;
  }
}

}  // namespace
}  // namespace shoal::testing
