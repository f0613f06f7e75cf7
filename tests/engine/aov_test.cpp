// The layers beside the colour against what the scene says, and their memory.
#include "engine/aov.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "engine/aov_film.h"
#include "engine/render.h"
#include "tests/engine/built_scene.h"

namespace shoal::testing {
namespace {

using nlohmann::json;
constexpr float kHalfHeight = 1, kDistance = 4;  ///< of what the camera sees at that distance: a square of side 2

/// The layers of one render by name: "albedo.R". Integers as numbers.
struct Layers {
  std::map<std::string, std::vector<double>> of;
  RenderResult result;

  Vec3 color(const std::string& name, size_t pixel, const char* channels) const {
    Vec3 value;
    for (int c = 0; c < 3; ++c) value[c] = static_cast<float>(of.at(name + '.' + channels[c])[pixel]);
    return value;
  }
  Vec3 albedo(size_t pixel) const { return color("albedo", pixel, "RGB"); }
  Vec3 normal(size_t pixel) const { return color("normal", pixel, "XYZ"); }
  Vec3 position(size_t pixel) const { return color("position", pixel, "XYZ"); }
};

class Aovs : public ::testing::Test {
 protected:
  Aovs() {
    picture.width = picture.height = 16;
    picture.samples = 4;
    picture.aovs = parse_aovs("all").value();
    picture.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(1), {}};
    scene.json["cameras"] = {
        {{"type", "perspective"}, {"perspective", {{"yfov", 2 * std::atan(kHalfHeight / kDistance)}, {"znear", 0.1}}}}};
    scene.add_node({{"camera", 0}});
  }

  uint32_t add_material(const json& pbr, const json& extensions = json::object()) {
    json material = {{"pbrMetallicRoughness", pbr}};
    for (const auto& [name, value] : extensions.items()) {
      material["extensions"][name] = value;
      scene.json["extensionsUsed"].push_back(name);
    }
    scene.json["materials"].push_back(material);
    return static_cast<uint32_t>(scene.json["materials"].size() - 1);
  }
  /// A rectangle from `corner` along two edges, its uv from 0 to 1 along them.
  uint32_t add_quad(const Vec3& corner, const Vec3& u, const Vec3& v, uint32_t material) {
    std::vector<float> points;
    for (const Vec3& p : {corner, corner + u, corner + u + v, corner + v}) points.insert(points.end(), {p.x, p.y, p.z});
    const uint32_t positions = scene.add_floats(3, points), uv = scene.add_floats(2, {0, 0, 1, 0, 1, 1, 0, 1});
    return scene.add_mesh({{"attributes", {{"POSITION", positions}, {"TEXCOORD_0", uv}}},
                           {"indices", scene.add_indices({0, 1, 2, 0, 2, 3})},
                           {"material", material}});
  }
  /// The wall that fills the picture.
  uint32_t add_wall(uint32_t material) { return add_quad({-2, -2, -kDistance}, {4, 0, 0}, {0, 4, 0}, material); }

  Layers render_layers(const ExecutionOptions& execution = {}) {
    if (!built) {
      scene.save(fs);
      built.emplace(build_and_open(fs));
    }
    auto result = render(fs, built->scene, picture, execution);
    if (!result.ok()) throw std::runtime_error(result.error().message);
    Layers layers;
    for (const ExrChannel& layer : result.value().layers) {
      std::vector<double>& values = layers.of[layer.name];
      values.assign(layer.values.begin(), layer.values.end());
      if (!layer.integers.empty()) values.assign(layer.integers.begin(), layer.integers.end());
      EXPECT_EQ(values.size(), size_t{picture.width} * picture.height) << layer.name;
    }
    layers.result = std::move(result).value();
    return layers;
  }
  size_t pixel(uint32_t x, uint32_t y) const { return size_t{y} * picture.width + x; }

  MemoryFileSystem fs;
  WrittenScene scene;
  std::optional<BuiltScene> built;
  PictureOptions picture;
};

void expect_near(const Vec3& value, const Vec3& expected, float tolerance) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(value[c], expected[c], tolerance) << "channel " << c;
}

TEST_F(Aovs, AWallShowsItsAlbedoNormalDepthAndPlace) {
  const uint32_t matte = add_material({{"baseColorFactor", {0.25, 0.5, 0.75, 1}}, {"metallicFactor", 0}});
  scene.add_node({{"mesh", add_wall(matte)}});
  const Layers layers = render_layers();
  ASSERT_EQ(layers.of.size(), 18u);
  for (uint32_t y = 0; y < picture.height; ++y) {
    for (uint32_t x = 0; x < picture.width; ++x) {
      const size_t p = pixel(x, y);
      EXPECT_EQ(layers.albedo(p), Vec3(0.25f, 0.5f, 0.75f));
      EXPECT_EQ(layers.normal(p), Vec3(0, 0, 1));
      const float size = 2.0f / 16, left = static_cast<float>(x) * size - 1, top = 1 - static_cast<float>(y) * size;
      expect_near(layers.position(p), Vec3(left + size / 2, top - size / 2, -kDistance), size / 2);
      // A mean over the pixel: between what its nearest and its farthest corner have.
      const auto [near_x, far_x] = std::minmax({std::abs(left), std::abs(left + size)});
      const auto [near_y, far_y] = std::minmax({std::abs(top), std::abs(top - size)});
      EXPECT_GE(layers.of.at("depth.Z")[p], std::hypot(near_x, near_y, kDistance) - 1e-5f);
      EXPECT_LE(layers.of.at("depth.Z")[p], std::hypot(far_x, far_y, kDistance) + 1e-5f);
      EXPECT_EQ(layers.of.at("samples.Y")[p], 4);
      EXPECT_EQ(layers.of.at("object_id.Y")[p], 1);
      EXPECT_EQ(layers.of.at("material_id.Y")[p], 1);
      EXPECT_GE(layers.of.at("treelets.Y")[p], 4) << "every camera ray enters one";
    }
  }
}

TEST_F(Aovs, WhatTheCameraSeesOfNothingIsEmpty) {
  const uint32_t white = add_material({{"metallicFactor", 0}});
  scene.add_node({{"mesh", add_quad({0, -2, -kDistance}, {4, 0, 0}, {0, 4, 0}, white)}});
  const Layers layers = render_layers();
  const size_t empty = pixel(1, 8), full = pixel(14, 8);
  EXPECT_EQ(layers.albedo(empty), Vec3(0));
  EXPECT_EQ(layers.normal(empty), Vec3(0));
  EXPECT_EQ(layers.position(empty), Vec3(0));
  EXPECT_TRUE(std::isinf(layers.of.at("depth.Z")[empty]));
  EXPECT_EQ(layers.of.at("object_id.Y")[empty], 0);
  EXPECT_EQ(layers.of.at("material_id.Y")[empty], 0);
  EXPECT_EQ(layers.of.at("samples.Y")[empty], 4);
  EXPECT_EQ(layers.of.at("object_id.Y")[full], 1);
  EXPECT_EQ(layers.albedo(full), Vec3(1));
}

TEST_F(Aovs, AnEdgeIsAntiAliasedAndNormalsAreNotMadeLonger) {
  // The edge runs through the middle of the pixels of column 8.
  scene.add_node({{"mesh", add_quad({1.0f / 16, -2, -kDistance}, {4, 0, 0}, {0, 4, 0},
                                    add_material({{"baseColorFactor", {1, 0, 0, 1}}, {"metallicFactor", 0}}))}});
  picture.samples = 256;
  const Layers layers = render_layers();
  for (uint32_t y = 0; y < 16; ++y) {
    const size_t p = pixel(8, y);
    const float covered = layers.result.rgba[4 * p + 3];
    EXPECT_NEAR(covered, 0.5f, 0.15f);
    expect_near(layers.albedo(p), Vec3(covered, 0, 0), 1e-6f);
    expect_near(layers.normal(p), Vec3(0, 0, covered), 1e-6f);
    EXPECT_NEAR(layers.position(p).z, -kDistance, 1e-5f) << "of what was hit only";
  }
}

TEST_F(Aovs, AlbedoIsThatOfTheTexture) {
  const uint32_t texture = scene.add_texture(
      fs, 2, 2, {255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 255, 255, 255, 255});
  scene.json["samplers"] = {{{"magFilter", 9728}, {"minFilter", 9728}}};
  scene.json["textures"][texture]["sampler"] = 0;
  const uint32_t material = add_material({{"baseColorTexture", {{"index", texture}}}, {"metallicFactor", 0}});
  scene.add_node({{"mesh", add_quad({-1, 1, -kDistance}, {2, 0, 0}, {0, -2, 0}, material)}});
  const Layers layers = render_layers();
  EXPECT_EQ(layers.albedo(pixel(3, 3)), Vec3(1, 0, 0));
  EXPECT_EQ(layers.albedo(pixel(12, 3)), Vec3(0, 1, 0));
  EXPECT_EQ(layers.albedo(pixel(3, 12)), Vec3(0, 0, 1));
  EXPECT_EQ(layers.albedo(pixel(12, 12)), Vec3(1));
  EXPECT_EQ(layers.normal(pixel(3, 3)), Vec3(0, 0, 1)) << "of the side seen: this quad shows its back";
}

TEST_F(Aovs, ASphereHasTheNormalsOfASphere) {
  constexpr int kSteps = 64;
  std::vector<float> points, normals;
  std::vector<uint32_t> indices;
  const Vec3 center(0, 0, -kDistance);
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      const float a = 3.14159265f * static_cast<float>(i) / kSteps, b = 6.2831853f * static_cast<float>(j) / kSteps;
      const Vec3 n(std::sin(a) * std::cos(b), std::cos(a), std::sin(a) * std::sin(b)), p = center + 0.75f * n;
      points.insert(points.end(), {p.x, p.y, p.z});
      normals.insert(normals.end(), {n.x, n.y, n.z});
      if (i == kSteps) continue;
      const auto at = [](int row, int column) { return static_cast<uint32_t>(row * kSteps + column % kSteps); };
      for (const uint32_t corner : {at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)}) {
        indices.push_back(corner);
      }
    }
  }
  scene.add_node({{"mesh", scene.add_mesh({{"attributes",
                                            {{"POSITION", scene.add_floats(3, points)},
                                             {"NORMAL", scene.add_floats(3, normals)}}},
                                           {"indices", scene.add_indices(indices)},
                                           {"material", add_material({{"metallicFactor", 0}})}})}});
  picture.samples = 1;
  const Layers layers = render_layers();
  int compared = 0;
  for (size_t p = 0; p < 256; ++p) {
    if (layers.of.at("object_id.Y")[p] == 0) continue;
    const Vec3 expected = glm::normalize(layers.position(p) - center);
    if (expected.z < 0.35f) continue;  // there the normal is leaned towards the eye
    expect_near(layers.normal(p), expected, 0.02f);
    ++compared;
  }
  EXPECT_GT(compared, 60);
}

TEST_F(Aovs, MirrorsShowTheAlbedoOfWhatIsSeenInThem) {
  const uint32_t mirror = add_material({{"baseColorFactor", {1, 0.5, 0.5, 1}}, {"roughnessFactor", 0}});
  const uint32_t red = add_material({{"baseColorFactor", {0.5, 0.25, 0, 1}}, {"metallicFactor", 0}});
  scene.add_node({{"mesh", add_wall(mirror)}});
  scene.add_node({{"mesh", add_quad({-50, -50, 5}, {0, 100, 0}, {100, 0, 0}, red)}});  // behind the camera
  const Layers layers = render_layers();
  for (size_t p = 0; p < 256; ++p) {
    expect_near(layers.albedo(p), Vec3(0.5f, 0.125f, 0), 0.01f);
    EXPECT_EQ(layers.normal(p), Vec3(0, 0, 1));
    EXPECT_NEAR(layers.position(p).z, -kDistance, 1e-5f) << "of the mirror";
    EXPECT_EQ(layers.of.at("material_id.Y")[p], 1);
  }
}

TEST_F(Aovs, AMirrorThatIsNotFollowedShowsItsOwnColor) {
  scene.add_node({{"mesh", add_wall(add_material({{"baseColorFactor", {1, 0.5, 0.5, 1}}, {"roughnessFactor", 0}}))}});
  const Layers to_the_sky = render_layers();
  picture.shading.bounces = 0;
  const Layers no_bounce = render_layers();
  for (size_t p = 0; p < 256; ++p) {
    expect_near(to_the_sky.albedo(p), Vec3(1, 0.5f, 0.5f), 0.01f);
    EXPECT_EQ(no_bounce.albedo(p), Vec3(1, 0.5f, 0.5f));
  }
}

TEST_F(Aovs, ClearGlassShowsTheAlbedoBehindIt) {
  const uint32_t glass = add_material({{"roughnessFactor", 0}, {"metallicFactor", 0}},
                                      {{"KHR_materials_transmission", {{"transmissionFactor", 1}}}});
  const uint32_t wall = add_material({{"baseColorFactor", {0.5, 0.25, 0.125, 1}}, {"metallicFactor", 0}});
  scene.add_node({{"mesh", add_quad({-2, -2, -2}, {4, 0, 0}, {0, 4, 0}, glass)}});
  scene.add_node({{"mesh", add_wall(wall)}});
  picture.samples = 64;
  const Layers layers = render_layers();
  for (size_t p = 0; p < 256; ++p) {
    // 4 % of the light is reflected: there the sky is seen, white.
    expect_near(layers.albedo(p), 0.96f * Vec3(0.5f, 0.25f, 0.125f) + Vec3(0.04f), 0.15f);
    EXPECT_NEAR(layers.position(p).z, -2, 1e-5f) << "of the glass";
  }
}

TEST_F(Aovs, EveryMeshThatIsShownHasANumberOfItsOwn) {
  const uint32_t matte = add_material({{"metallicFactor", 0}}), other = add_material({{"metallicFactor", 0}});
  const uint32_t shared = add_quad({-0.25f, -0.25f, -kDistance}, {0.5f, 0, 0}, {0, 0.5f, 0}, matte);
  scene.add_node({{"mesh", add_quad({-1, -1, -kDistance}, {1, 0, 0}, {0, 1, 0}, matte)}});
  scene.add_node({{"mesh", add_quad({-1, 0, -kDistance}, {1, 0, 0}, {0, 1, 0}, other)}});
  scene.add_node({{"mesh", shared}, {"translation", {0.5, 0.5, 0}}});
  scene.add_node({{"mesh", shared}, {"translation", {0.5, -0.5, 0}}});
  const Layers layers = render_layers();
  const std::vector<double>& ids = layers.of.at("object_id.Y");
  EXPECT_EQ(ids[pixel(4, 12)], 1);
  EXPECT_EQ(ids[pixel(4, 4)], 2);
  EXPECT_EQ(ids[pixel(12, 4)], 3);
  EXPECT_EQ(ids[pixel(12, 12)], 4);
  EXPECT_EQ(layers.of.at("material_id.Y")[pixel(4, 12)], 1);
  EXPECT_EQ(layers.of.at("material_id.Y")[pixel(4, 4)], 2);
  picture.samples = 1;
  EXPECT_EQ(render_layers().of.at("object_id.Y"), ids) << "of sample 0, however many there are";
}

TEST_F(Aovs, VarianceIsThatOfTheSamples) {
  scene.add_node({{"mesh", add_wall(add_material({{"metallicFactor", 0}}))}});
  scene.add_node({{"mesh", add_quad({-1, -1, -3}, {1, 0, 0}, {0, 2, 0.5f}, add_material({{"metallicFactor", 0}}))}});
  picture.aovs = parse_aovs("variance").value();
  constexpr uint32_t kSamples = 6;
  // A render of k samples holds the first k of them all, so that the differences of its sums are samples.
  std::vector<std::vector<double>> samples(3 * 256);
  std::vector<double> before(3 * 256, 0.0);
  Layers layers;
  for (uint32_t k = 1; k <= kSamples; ++k) {
    picture.samples = k;
    layers = render_layers();
    EXPECT_EQ(layers.of.size(), 3u);
    for (size_t i = 0; i < 3 * 256; ++i) {
      const double sum = double{layers.result.rgba[i / 3 * 4 + i % 3]} * k;
      samples[i].push_back(sum - before[i]);
      before[i] = sum;
    }
  }
  double largest = 0;
  for (size_t i = 0; i < 3 * 256; ++i) {
    const double mean = before[i] / kSamples;
    double squares = 0;
    for (const double sample : samples[i]) squares += (sample - mean) * (sample - mean);
    const double variance = layers.of.at(std::string("variance.") + "RGB"[i % 3])[i / 3];
    EXPECT_NEAR(variance, squares / (kSamples - 1), 1e-4 * variance + 1e-6);
    largest = std::max(largest, variance);
  }
  EXPECT_GT(largest, 1e-3) << "a picture without noise proves nothing";
}

TEST_F(Aovs, WithoutThemThereAreNoLayersAndNoMemoryIsPlanned) {
  scene.add_node({{"mesh", add_wall(add_material({{"metallicFactor", 0}}))}});
  const Layers with = render_layers();
  picture.aovs = {};
  const Layers without = render_layers();
  EXPECT_TRUE(without.of.empty());
  EXPECT_EQ(without.result.plan.aov_bytes, 0u);
  EXPECT_GT(with.result.plan.aov_bytes, 256u * 200);
  EXPECT_EQ(with.result.rgba, without.result.rgba);
}

TEST_F(Aovs, TheirMemoryIsPartOfTheBudget) {
  scene.add_node({{"mesh", add_wall(add_material({{"metallicFactor", 0}}))}});
  render_layers();
  picture.width = picture.height = 2000;
  ExecutionOptions execution;
  execution.threads = 1;
  execution.max_memory_bytes = 800ull << 20;
  const auto plan = [&](AovSet aovs) {
    picture.aovs = aovs;
    return plan_before_tables(fs, *built->scene.file, picture, execution);
  };
  const auto none = plan({}), albedo = plan(parse_aovs("albedo").value()), all = plan(parse_aovs("all").value());
  ASSERT_TRUE(none.ok() && albedo.ok());
  EXPECT_GE(albedo.value().aov_bytes, 4000000u * 36);
  EXPECT_LE(albedo.value().total_bytes(), execution.max_memory_bytes);
  ASSERT_FALSE(all.ok());
  EXPECT_EQ(all.error().code, ErrorCode::kMemoryCap);
}

TEST(AovNames, AreParsedAndUnknownOnesNamed) {
  EXPECT_TRUE(parse_aovs("").value().empty());
  EXPECT_EQ(aov_names(parse_aovs("normal,albedo,normal").value()), (std::vector<std::string>{"albedo", "normal"}));
  EXPECT_EQ(aov_names(parse_aovs("all").value()).size(), kAovCount);
  for (const char* wrong : {"albedo,", ",", "Albedo", "normals", "albedo normal"}) {
    const auto set = parse_aovs(wrong);
    ASSERT_FALSE(set.ok()) << wrong;
    EXPECT_EQ(set.error().code, ErrorCode::kUsage);
    EXPECT_THAT(set.error().message, ::testing::HasSubstr("object_id"));
  }
}

}  // namespace
}  // namespace shoal::testing
