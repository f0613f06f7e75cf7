// Renders with a target for noise: the same picture in every order, errors that are what they are said to be, and a mean
// that is that of plain samples, on generated scenes and on real ones.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "engine/build_scene.h"
#include "engine/generate.h"
#include "engine/render.h"
#include "tests/support/render_variation.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/written_scene.h"

namespace shoal::testing {
namespace {

const RenderVariation kPlain{.name = "depth-first, one thread", .order = Order::kDepthFirst, .threads = 1};
const RenderVariation kVariations[] = {
    {.name = "depth-first, smallest cache", .order = Order::kDepthFirst, .threads = 3, .smallest_cache = true},
    {.name = "queued", .threads = 3},
    {.name = "queued, one block of rays", .threads = 1, .rays_in_flight = 64},
    {.name = "queued, smallest cache, with a preview", .rays_in_flight = 2000, .smallest_cache = true, .preview = true},
    {.name = "sorted", .order = Order::kSorted, .threads = 3},
    {.name = "hybrid", .order = Order::kHybrid, .threads = 3},
    {.name = "auto, with a preview", .order = Order::kAuto, .preview = true},
};

float luminance(const float* rgb) { return 0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2]; }

class AdaptiveRender : public ::testing::Test {
 protected:
  AdaptiveRender() {
    picture.width = 40, picture.height = 30;
    picture.shading.bounces = 4;
    picture.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(0.5f), {}};
  }

  void generate(const std::string& kind, uint64_t triangles) {
    GenerateOptions options;
    options.kind = kind;
    options.triangles = triangles;
    options.out_dir = folder / kind;
    const auto report = generate_scene(posix_file_system(), options);
    ASSERT_TRUE(report.ok());
    build(report.value().gltf_path);
  }
  void build(const std::string& gltf) {
    SceneBuildOptions build;
    build.treelet_bytes = 32u << 10;
    ASSERT_TRUE(build_scene(posix_file_system(), gltf, folder / "scene.shoal", build).ok());
  }

  /// A box that is open to the viewer: walls of colours, one with a gloss, a block in the middle, and a lamp of this
  /// half width under the ceiling that shines up or down.
  void build_box(float lamp, bool down) {
    WrittenScene scene;
    const auto material = [&](std::array<float, 3> color, float roughness, float metallic, float emission) {
      scene.json["materials"].push_back(
          {{"pbrMetallicRoughness", {{"baseColorFactor", {color[0], color[1], color[2], 1}},
                                     {"roughnessFactor", roughness}, {"metallicFactor", metallic}}},
           {"emissiveFactor", {1, 1, 1}}, {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", emission}}}}}});
      return scene.json["materials"].size() - 1;
    };
    scene.json["extensionsUsed"] = {"KHR_materials_emissive_strength"};
    const auto quad = [&](const Vec3& at, const Vec3& u, const Vec3& v, size_t of) {
      std::vector<float> points;
      for (const Vec3& p : {at, at + u, at + u + v, at + v}) points.insert(points.end(), {p.x, p.y, p.z});
      scene.add_node({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", scene.add_floats(3, points)}}},
                                               {"indices", scene.add_indices({0, 1, 2, 0, 2, 3})}, {"material", of}})}});
    };
    const size_t white = material({0.7f, 0.7f, 0.7f}, 1, 0, 0), red = material({0.7f, 0.1f, 0.1f}, 1, 0, 0);
    const size_t gloss = material({0.8f, 0.8f, 0.6f}, 0.15f, 1, 0), black = material({0, 0, 0}, 1, 0, 0);
    const size_t light = material({0, 0, 0}, 1, 0, 1 / (lamp * lamp));
    quad({-1, -1, -1}, {2, 0, 0}, {0, 2, 0}, white);   // behind
    quad({-1, -1, -1}, {0, 0, 2}, {2, 0, 0}, white);   // floor
    quad({-1, 1, -1}, {2, 0, 0}, {0, 0, 2}, white);    // ceiling
    quad({-1, -1, -1}, {0, 2, 0}, {0, 0, 2}, red);     // left
    quad({1, -1, -1}, {0, 0, 2}, {0, 2, 0}, gloss);    // right
    quad({-0.4f, -1, 0}, {0.5f, 0, 0.2f}, {0, 0.9f, 0}, black);
    quad({0.1f, -1, 0.2f}, {0.4f, 0, -0.3f}, {0, 0.5f, 0}, white);
    const float height = down ? 0.99f : 0.6f;
    quad({-lamp, height, -lamp}, {2 * lamp, 0, 0}, {0, 0, 2 * lamp}, light);
    quad({-lamp, height + (down ? 0.005f : -0.005f), -lamp}, {2 * lamp, 0, 0}, {0, 0, 2 * lamp}, black);
    scene.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.7}, {"znear", 0.1}}}}};
    scene.add_node({{"camera", 0}, {"translation", {0, 0, 4}}});
    MemoryFileSystem files;
    scene.save(files);
    for (const std::string& name : files.names()) {
      ASSERT_TRUE(write_whole_file(posix_file_system(), folder / name, files.contents(name)).ok());
    }
    picture.shading.environment.radiance = Vec3(0);
    build(folder / "scene.gltf");
  }

  RenderResult rendered(const RenderVariation& v = {.name = "", .order = Order::kHybrid}) {
    ExecutionOptions execution;
    execution.time_limit_seconds = time_limit;
    return render_variation(folder, picture, v, execution);
  }
  RenderResult adaptive(float median, uint32_t most, const RenderVariation& v = {.name = "", .order = Order::kHybrid}) {
    picture.noise = {median, 2 * median};
    picture.samples = most;
    return rendered(v);
  }
  RenderResult plain(uint32_t samples) {
    picture.noise = {};
    picture.samples = samples;
    return rendered();
  }

  static const ExrChannel& layer(const RenderResult& result, const std::string& name) {
    for (const ExrChannel& channel : result.layers) {
      if (channel.name == name) return channel;
    }
    throw std::runtime_error("no layer " + name);
  }
  /// The standard error of luminance in a plain render with the layer `variance`, at most.
  static double plain_error(const RenderResult& result, size_t pixel, uint32_t samples) {
    double deviation = 0;
    for (const auto& [name, weight] : {std::pair{"variance.R", 0.2126}, {"variance.G", 0.7152}, {"variance.B", 0.0722}}) {
      deviation += weight * std::sqrt(layer(result, name).values[pixel]);
    }
    return deviation / std::sqrt(samples);
  }

  /// At least 93 % of the pixels are within 1.96 of their estimated standard errors of many samples.
  void expect_honest(float target) {
    constexpr uint32_t kReference = 1024;
    const RenderResult estimate = adaptive(target, 256);
    picture.aovs = parse_aovs("variance").value();
    picture.shading.seed += 1000;
    const RenderResult reference = plain(kReference);
    const size_t pixels = size_t{picture.width} * picture.height;
    size_t inside = 0;
    for (size_t i = 0; i < pixels; ++i) {
      const double error = luminance(&estimate.rgba[4 * i]) - luminance(&reference.rgba[4 * i]);
      const double expected = std::hypot(estimate.standard_errors[i], plain_error(reference, i, kReference));
      inside += std::abs(error) <= 1.96 * expected + 1e-6 ? 1 : 0;
    }
    const double share = static_cast<double>(inside) / static_cast<double>(pixels);
    std::printf("%.2f %% within 1.96 standard errors; %.1f samples (%u to %u), %.1f drawn, noise %.4f and %.4f\n",
                100 * share, estimate.samples.mean, estimate.samples.least, estimate.samples.most,
                estimate.samples.drawn_mean, estimate.noise->median, estimate.noise->percentile_95);
    EXPECT_GE(share, 0.93);
    EXPECT_GT(estimate.noise->median, 0) << "a picture without noise proves nothing";
  }

  /// Skips the test without real scenes.
  bool build_real(const std::string& path) {
    const char* data = std::getenv("SHOAL_DATA");
    if (data != nullptr) build(std::string(data) + "/scenes/" + path);
    return data != nullptr;
  }

  TemporaryFolder folder;
  PictureOptions picture;
  double time_limit = 0;
};

TEST_F(AdaptiveRender, EveryOrderDrawsTheSameSamples) {
  generate("demo", 20000);
  picture.aovs = parse_aovs("albedo,variance,samples,object_id").value();
  picture.width = 32, picture.height = 24;
  const RenderResult expected = adaptive(0.2f, 48, kPlain);
  EXPECT_LT(expected.samples.least, expected.samples.most) << "a picture of equal samples proves little";
  EXPECT_GT(expected.samples.passes_count, 2u);
  for (const RenderVariation& v : kVariations) {
    const RenderResult actual = adaptive(0.2f, 48, v);
    EXPECT_EQ(actual.rgba, expected.rgba) << v.name;
    EXPECT_EQ(actual.standard_errors, expected.standard_errors) << v.name;
    for (size_t i = 0; i < expected.layers.size(); ++i) {
      EXPECT_EQ(actual.layers[i].values, expected.layers[i].values) << v.name << ", " << expected.layers[i].name;
      EXPECT_EQ(actual.layers[i].integers, expected.layers[i].integers) << v.name << ", " << expected.layers[i].name;
    }
    EXPECT_EQ(actual.counters.samples_committed_count, expected.counters.samples_committed_count) << v.name;
  }
}

TEST_F(AdaptiveRender, ReportsWhatItDrewAndWhatItReached) {
  generate("terrain", 5000);
  picture.aovs = parse_aovs("samples").value();
  const RenderResult result = adaptive(0.1f, 1024);
  ASSERT_TRUE(result.noise);
  EXPECT_TRUE(result.noise->meets(picture.noise));
  uint64_t sum = 0;
  uint32_t least = UINT32_MAX, most = 0;
  for (const uint32_t samples : layer(result, "samples.Y").integers) {
    sum += samples, least = std::min(least, samples), most = std::max(most, samples);
  }
  EXPECT_EQ(result.samples.least, least);
  EXPECT_EQ(result.samples.most, most);
  EXPECT_DOUBLE_EQ(result.samples.mean, static_cast<double>(sum) / (40 * 30));
  EXPECT_DOUBLE_EQ(result.samples.drawn_mean, static_cast<double>(result.counters.samples_committed_count) / (40 * 30));
  EXPECT_GE(result.samples.drawn_mean, result.samples.mean);
  EXPECT_GE(result.plan.noise_bytes, 40u * 30 * 98);
  EXPECT_EQ(result.standard_errors.size(), 40u * 30);
  EXPECT_FALSE(adaptive(0.001f, 16).noise->meets(picture.noise)) << "too few samples for that";
}

TEST_F(AdaptiveRender, ATimeLimitEndsItBefore) {
  generate("terrain", 5000);
  time_limit = 1e-3;
  const RenderResult result = adaptive(0.001f, 1u << 20);
  EXPECT_EQ(result.samples.most, 2u) << "the first pass";
  EXPECT_FALSE(result.noise) << "nothing can be told of that";
  time_limit = 1e6;
  EXPECT_TRUE(adaptive(0.2f, 1u << 20).noise->meets(picture.noise));
}

TEST_F(AdaptiveRender, TilesThatAreLeftOutStayBlack) {
  generate("terrain", 5000);
  picture.width = 128, picture.height = 64;
  picture.tile_sample = 4;
  const RenderResult result = adaptive(0.2f, 64);
  EXPECT_EQ(result.picture_share, 0.25);
  EXPECT_GE(result.samples.least, 16u);
  size_t black = 0;
  for (size_t i = 0; i < result.rgba.size(); i += 4) black += result.rgba[i] == 0 && result.standard_errors[i / 4] == 0;
  EXPECT_GE(black, 128u * 64 / 4 * 3);
}

TEST_F(AdaptiveRender, TheMeanOfManySeedsIsThatOfManySamples) {
  generate("instances", 20000);
  picture.width = 24, picture.height = 16;
  constexpr uint64_t kSeeds = 64;
  constexpr uint32_t kReference = 2048;
  const size_t values = size_t{24} * 16 * 4;
  std::vector<double> sum(values), squares(values);
  double mean_sum = 0, mean_squares = 0, drawn = 0;
  uint64_t decided = 0;
  for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
    picture.shading.seed = seed;
    const RenderResult result = adaptive(0.1f, 96);
    double mean = 0;
    for (size_t i = 0; i < values; ++i) {
      const double value = result.rgba[i];
      sum[i] += value, squares[i] += value * value;
      mean += i % 4 < 3 ? value : 0;
    }
    mean_sum += mean, mean_squares += mean * mean;
    drawn += result.samples.drawn_mean;
    decided += result.samples.least < result.samples.most ? 1 : 0;
  }
  EXPECT_GE(decided, kSeeds * 3 / 4) << "pictures of equal samples prove nothing";
  picture.shading.seed = 1000000;
  picture.shading.sampler = SamplerKind::kIndependent;  // whose error is what the variance of its samples says
  picture.aovs = parse_aovs("variance").value();
  const RenderResult reference = plain(kReference);
  double reference_mean = 0, reference_variance = 0, deviations = 0;
  size_t noisy = 0;
  for (size_t i = 0; i < values; ++i) {
    if (i % 4 == 3) continue;
    const double variance = layer(reference, std::string("variance.") + "RGB"[i % 4]).values[i / 4] / kReference;
    reference_mean += reference.rgba[i], reference_variance += variance;
    const double mean = sum[i] / kSeeds, of_mean = (squares[i] / kSeeds - mean * mean) / (kSeeds - 1);
    if (of_mean + variance < 1e-12) continue;
    deviations += std::pow(mean - reference.rgba[i], 2) / (of_mean + variance);
    ++noisy;
  }
  // Channels go together, so the picture's mean varies by more than their sum: three times at most.
  const double mean = mean_sum / kSeeds, of_mean = (mean_squares / kSeeds - mean * mean) / (kSeeds - 1);
  const double deviation = (mean - reference_mean) / std::sqrt(of_mean + 3 * reference_variance);
  std::printf("picture: %.2f standard errors; pixels: %.3f, root mean square; %.1f samples\n", deviation,
              std::sqrt(deviations / static_cast<double>(noisy)), drawn / kSeeds);
  EXPECT_LT(std::abs(deviation), 3);
  EXPECT_NEAR(std::sqrt(deviations / static_cast<double>(noisy)), 1, 0.1);
}

TEST_F(AdaptiveRender, ErrorsHoldOnTerrain) {
  generate("terrain", 20000);
  expect_honest(0.05f);
}
TEST_F(AdaptiveRender, ErrorsHoldOnInstancesWithCoverage) {
  generate("instances", 100000);
  expect_honest(0.08f);
}
TEST_F(AdaptiveRender, ErrorsHoldOnTheDemo) {
  generate("demo", 50000);
  expect_honest(0.08f);
}
TEST_F(AdaptiveRender, ErrorsHoldInABoxWithALargeLamp) {
  build_box(0.5f, true);
  expect_honest(0.1f);
}
TEST_F(AdaptiveRender, ErrorsHoldInABoxWithATinyLampThatShinesUp) {
  build_box(0.02f, false);
  expect_honest(0.1f);
}
#define SHOAL_REAL_SCENE_TEST(name, path, sky, target)                                      \
  TEST_F(AdaptiveRender, ErrorsHoldOn##name) {                                              \
    picture.shading.environment.radiance = Vec3(sky);                                       \
    if (!build_real(path)) GTEST_SKIP() << "SHOAL_DATA is not set: no real scenes";         \
    expect_honest(target);                                                                  \
  }
SHOAL_REAL_SCENE_TEST(Coffee, "coffee/coffee.gltf", 0, 0.15f)
SHOAL_REAL_SCENE_TEST(Kitchen, "kitchen/kitchen.gltf", 0, 0.15f)
SHOAL_REAL_SCENE_TEST(Lamp, "lamp/lamp.gltf", 0, 0.15f)
SHOAL_REAL_SCENE_TEST(Helmet, "helmet/helmet.gltf", 1, 0.05f)
SHOAL_REAL_SCENE_TEST(MaterialTestball, "material-testball/material-testball.gltf", 1, 0.05f)

}  // namespace
}  // namespace shoal::testing
