// Levels of textures from the cones of rays, against the widths that they are made for.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "engine/render.h"
#include "engine/texture_footprint.h"
#include "tests/engine/built_scene.h"
#include "tests/support/textured_quads.h"

namespace shoal::testing {
namespace {

/// A triangle in the plane z = 0 whose uv are x and y, seen from a direction at `tilt` radians from its normal.
Surface tilted(float tilt, float uv_scale = 1) {
  Surface s;
  s.edge1 = {2, 0, 0}, s.edge2 = {0, 3, 0};
  s.attributes.corner[1].uv[0] = {2 * uv_scale, 0}, s.attributes.corner[2].uv[0] = {0, 3 * uv_scale};
  s.geometric_normal = {0, 0, 1};
  s.wo = {std::sin(tilt), 0, std::cos(tilt)};
  return s;
}

Texture square(uint32_t side) {
  Texture texture;
  texture.width = texture.height = side;
  while (side >> texture.level_count != 0) ++texture.level_count;
  return texture;
}

/// The mean over the choice between levels.
double mean_level(const Surface& surface, float width, const Texture& texture, const float* transform = nullptr) {
  constexpr int kSteps = 1000;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    sum += TextureFootprint(surface, width, static_cast<float>(i) / kSteps).level(texture, 0, transform);
  }
  return sum / kSteps;
}

TEST(RayCone, KeepsItsWidthsInTwoHalvesOfAWord) {
  std::mt19937 random(3);
  for (int i = 0; i < 10000; ++i) {
    const float width = std::ldexp(1 + static_cast<float>(random() >> 9) * 0x1p-23f, static_cast<int>(random() % 200) - 100);
    const float spread = static_cast<float>(random() >> 8) * 0x1p-24f;
    const RayCone cone = unpack_cone(pack_cone({width, spread}));
    EXPECT_NEAR(cone.width, width, width * 0x1p-8f);
    EXPECT_NEAR(cone.spread, spread, spread * 0x1p-8f + 0x1p-120f);
  }
  EXPECT_EQ(unpack_cone(0).width, 0);
  EXPECT_EQ(unpack_cone(0).spread, 0);
  const float infinity = std::numeric_limits<float>::infinity();
  for (const float wide : {infinity, -infinity * 0, std::numeric_limits<float>::max()}) {
    EXPECT_TRUE(std::isfinite(unpack_cone(pack_cone({wide, 0})).width));
    EXPECT_GT(unpack_cone(pack_cone({wide, 0})).width, 1e38f);
  }
}

TEST(RayCone, GrowsWithTheLobeAndNotBeyondItsLimit) {
  const RayCone before{0.25f, 0.001f};
  EXPECT_NEAR(scattered_cone(before, 1e12f).spread, before.spread, 1e-6f) << "a mirror";
  EXPECT_EQ(scattered_cone(before, 1e12f).width, before.width);
  // A lobe of one steradian: a sixteenth of it is a cone of half-angle 0.141.
  EXPECT_NEAR(scattered_cone({0, 0}, 1).spread, 2 * std::sqrt(1 / (16 * 3.14159265f)), 1e-6f);
  EXPECT_EQ(scattered_cone(before, 1e-30f).spread, kMaxConeSpread);
}

TEST(TextureFootprint, TakesTheLevelWhoseTexelsAreAsWideAsTheCone) {
  const Texture texture = square(1024);
  for (const float texels : {0.01f, 0.9f, 1.0f, 2.0f, 3.0f, 5.7f, 64.0f, 200.0f}) {
    const double wanted = std::max(0.0, std::log2(static_cast<double>(texels)));
    EXPECT_NEAR(mean_level(tilted(0), texels / 1024, texture), wanted, 0.09) << texels;
  }
  EXPECT_EQ(mean_level(tilted(0), 50, texture), 10) << "never coarser than one texel";
}

TEST(TextureFootprint, FollowsTheShorterAxisOfATiltedSurfaceUpToAnEighth) {
  const Texture texture = square(1024);
  const float width = 16.0f / 1024;
  EXPECT_NEAR(mean_level(tilted(1.2f), width, texture), 4, 0.09);
  // The longer axis is 1 / cos times the shorter; beyond eight times the level rises.
  const float tilt = std::acos(1 / 32.0f);
  EXPECT_NEAR(mean_level(tilted(tilt), width, texture), 4 + 2, 0.09);
}

TEST(TextureFootprint, GrowsWithTheScaleOfUvAndOfItsTransform) {
  const Texture texture = square(1024);
  const float width = 4.0f / 1024;
  EXPECT_NEAR(mean_level(tilted(0, 4), width, texture), 4, 0.09);
  const float turned_and_doubled[6] = {0, 2, 0.3f, -2, 0, 0.7f};
  EXPECT_NEAR(mean_level(tilted(0), width, texture, turned_and_doubled), 3, 0.09);
}

TEST(TextureFootprint, IsLevelZeroWhereItIsNotDefined) {
  const Texture texture = square(1024);
  Surface flat = tilted(0);
  flat.edge2 = flat.edge1;
  EXPECT_EQ(TextureFootprint(flat, 1, 0.5f).level(texture, 0, nullptr), 0u);
  EXPECT_EQ(TextureFootprint(tilted(0), 1, 0.5f).level(texture, 4, nullptr), 0u) << "no such set";
  EXPECT_EQ(TextureFootprint(tilted(0), 0, 0.5f).level(texture, 0, nullptr), 0u);
  Surface endless = tilted(0);
  endless.attributes.corner[1].uv[0].x = std::numeric_limits<float>::infinity();
  EXPECT_LT(TextureFootprint(endless, 1, 0.5f).level(texture, 0, nullptr), texture.level_count);
  const Surface aside = tilted(1.5707963f);
  EXPECT_LT(TextureFootprint(aside, 1, 0.999f).level(texture, 0, nullptr), texture.level_count);
}

TEST(TextureFootprint, RoughLog2IsExactAtPowersOfTwoAndNeverFarBelow) {
  for (int e = 0; e < 100; ++e) EXPECT_EQ(rough_log2(std::ldexp(1.0f, e)), static_cast<float>(e));
  for (float v = 1; v < 4; v += 0.001f) {
    EXPECT_LE(rough_log2(v), std::log2(v) + 1e-6f);
    EXPECT_GE(rough_log2(v), std::log2(v) - 0.087f);
  }
}

struct FilteredPicture {
  std::vector<float> rgba;
  uint64_t tiles_read = 0;
};

FilteredPicture noise_wall(TextureFilter filter, uint32_t samples) {
  MemoryFileSystem fs;
  textured_quads(fs, 2, 1024).save(fs);
  const BuiltScene built = build_and_open(fs);
  PictureOptions picture;
  picture.width = 32, picture.height = 16, picture.samples = samples;
  picture.shading.bounces = 1;
  picture.shading.texture_filter = filter;
  picture.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(1), {}};
  auto result = render(fs, built.scene, picture, {});
  EXPECT_TRUE(result.ok());
  if (!result.ok()) return {};
  return {result.value().rgba, result.value().counters.texture_loads_count};
}

struct Spread {
  double mean = 0, variance = 0;
};
Spread green(const std::vector<float>& rgba) {
  Spread s;
  const double n = static_cast<double>(rgba.size() / 4);
  for (size_t i = 1; i < rgba.size(); i += 4) s.mean += rgba[i] / n;
  for (size_t i = 1; i < rgba.size(); i += 4) s.variance += (rgba[i] - s.mean) * (rgba[i] - s.mean) / n;
  return s;
}

TEST(TextureFilter, SeesTheMeanOfFineTexelsFromAfarAndReadsFewOfThem) {
  // 64 texels a pixel of noise, lit from everywhere: every pixel is the noise's mean but for what light samples vary.
  const FilteredPicture fine = noise_wall(TextureFilter::kBilinear, 4), mip = noise_wall(TextureFilter::kMip, 4);
  const FilteredPicture truth = noise_wall(TextureFilter::kBilinear, 256);
  const Spread of_fine = green(fine.rgba), of_mip = green(mip.rgba), expected = green(truth.rgba);
  EXPECT_LT(of_mip.variance, of_fine.variance / 5);
  // Four standard errors of the mean of 512 pixels.
  EXPECT_NEAR(of_mip.mean, expected.mean, 4 * std::sqrt(of_mip.variance / 512) + 4 * std::sqrt(expected.variance / 512));
  EXPECT_LT(mip.tiles_read * 10, fine.tiles_read);
  EXPECT_GT(mip.tiles_read, 0u);
}

}  // namespace
}  // namespace shoal::testing
