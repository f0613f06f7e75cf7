#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "engine/mip_pyramid.h"
#include "engine/tile_textures.h"
#include "tests/engine/built_scene.h"

namespace shoal::testing {
namespace {

double decode(uint8_t code) {  // IEC 61966-2-1, by the C library
  const double x = code / 255.0;
  return x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4);
}
double encode(double x) { return 255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055); }

Image8 noise(uint32_t width, uint32_t height, uint32_t seed) {
  std::mt19937 random(seed);
  Image8 image{width, height, true, {}};
  for (size_t i = 0; i < size_t{4} * width * height; ++i) image.rgba.push_back(static_cast<uint8_t>(random()));
  return image;
}

/// A level in double, linear, 4 values a texel.
struct Level {
  uint32_t width, height;
  std::vector<double> values;
};

Level linear_level(const Image8& image, bool srgb) {
  Level level{image.width, image.height, {}};
  for (size_t i = 0; i < image.rgba.size(); ++i) {
    level.values.push_back(srgb && i % 4 != 3 ? decode(image.rgba[i]) : image.rgba[i] / 255.0);
  }
  return level;
}

/// Every texel the mean over exactly the area [x / w, (x + 1) / w) x [y / h, (y + 1) / h) of the level before.
Level brute_next(const Level& fine) {
  const auto overlap = [](double a, double b, double texel) {
    return std::max(0.0, std::min(b, texel + 1) - std::max(a, texel));
  };
  Level out{std::max(1u, fine.width / 2), std::max(1u, fine.height / 2), {}};
  const double sx = double(fine.width) / out.width, sy = double(fine.height) / out.height;
  for (uint32_t texel = 0; texel < out.width * out.height; ++texel) {
    const uint32_t x = texel % out.width, y = texel / out.width;
    for (uint32_t c = 0; c < 4; ++c) {
      double sum = 0;
      for (uint32_t i = 0; i < fine.width * fine.height; ++i) {
        sum += overlap(x * sx, (x + 1) * sx, i % fine.width) * overlap(y * sy, (y + 1) * sy, i / fine.width) *
               fine.values[4 * i + c];
      }
      out.values.push_back(sum / (sx * sy));
    }
  }
  return out;
}

TEST(MipPyramid, EveryTexelIsTheMeanOfItsAreaInLinearLight) {
  for (const auto& [width, height] : {std::pair{8u, 8u}, {13u, 7u}, {1u, 9u}, {31u, 2u}}) {
    for (const bool srgb : {false, true}) {
      const Image8 image = noise(width, height, width);
      Level expected = linear_level(image, srgb);
      MipPyramid pyramid(Image8(image), srgb);
      uint32_t levels = 1;
      for (; pyramid.next(); ++levels) {
        expected = brute_next(expected);
        const Image8& level = pyramid.level();
        ASSERT_EQ(level.width, std::max(1u, width >> pyramid.level_index()));
        ASSERT_EQ(level.height, std::max(1u, height >> pyramid.level_index()));
        for (size_t i = 0; i < level.rgba.size(); ++i) {
          const double value = srgb && i % 4 != 3 ? encode(expected.values[i]) : 255 * expected.values[i];
          EXPECT_NEAR(level.rgba[i], value, 0.501) << width << " x " << height << " srgb " << srgb;
        }
      }
      EXPECT_EQ(levels, full_level_count(width, height));
    }
  }
}

TEST(MipPyramid, TheLastTexelIsTheMeanOfThePicture) {
  for (const auto& [width, height] : {std::pair{31u, 17u}, {7u, 1u}, {12u, 5u}}) {
    MipPyramid pyramid(noise(width, height, height), true);
    double mean[4];
    pyramid.mean(mean);
    while (pyramid.next()) {
    }
    for (int c = 0; c < 4; ++c) {
      EXPECT_NEAR(pyramid.level().rgba[c], c < 3 ? encode(mean[c]) : 255 * mean[c], 0.501);
    }
  }
}

TEST(MipPyramid, SrgbTablesGoThereAndBack) {
  for (int code = 0; code < 256; ++code) {
    EXPECT_EQ(srgb_tables().to_code(srgb_tables().to_linear(static_cast<uint8_t>(code))), code);
    EXPECT_NEAR(srgb_tables().to_linear(static_cast<uint8_t>(code)), decode(static_cast<uint8_t>(code)), 1e-5);
  }
  EXPECT_EQ(srgb_tables().to_code(2.0f), 255);
  EXPECT_EQ(srgb_tables().to_code(0.0f), 0);
}

struct TexturedScene {
  MemoryFileSystem fs;
  WrittenScene scene;
  Image8 image;

  /// One triangle whose material uses the picture as `material` says; "texture" stands for its index.
  explicit TexturedScene(const Image8& picture) : image(picture) {
    scene.add_texture(fs, picture.width, picture.height, picture.rgba);
  }
  BuiltScene build(const nlohmann::json& material) {
    scene.json["materials"] = {material};
    const nlohmann::json attributes = {{"POSITION", scene.add_floats(3, {0, 0, 0, 1, 0, 0, 0, 1, 0})},
                                       {"TEXCOORD_0", scene.add_floats(2, {0, 0, 1, 0, 0, 1})}};
    scene.add_node({{"mesh", scene.add_mesh({{"attributes", attributes}, {"material", 0}})}});
    scene.save(fs);
    return build_and_open(fs);
  }
};

std::vector<std::byte> read_tile(const Scene& scene, PageId page) {
  std::vector<std::byte> bytes(scene.file->record(page).raw_bytes);
  uint64_t read_bytes = 0;
  EXPECT_TRUE(scene.file->read_page(page, bytes, &read_bytes).ok());
  return bytes;
}

TEST(TextureTiles, HoldEveryTexelAndRepeatTheBorder) {
  TexturedScene textured(noise(150, 70, 1));
  const BuiltScene built = textured.build({{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
  ASSERT_EQ(built.scene.textures.size(), 1u);
  const Texture& texture = built.scene.textures[0];
  EXPECT_EQ(texture.srgb, 1);
  EXPECT_EQ(texture.level_count, 8u);
  EXPECT_EQ(texture.first_page[1] - texture.first_page[0], 6u);
  for (uint32_t tile = 0; tile < 6; ++tile) {
    const auto bytes = read_tile(built.scene, texture.first_page[0] + tile);
    ASSERT_EQ(bytes.size(), kTextureTileBytes);
    for (uint32_t i = 0; i < kTextureTileTexels * kTextureTileTexels; ++i) {
      const uint32_t x = std::min(149u, tile % 3 * 64 + i % 64), y = std::min(69u, tile / 3 * 64 + i / 64);
      ASSERT_EQ(0, std::memcmp(&bytes[4 * i], &textured.image.rgba[4 * (y * 150 + x)], 4)) << tile << " " << i;
    }
  }
}

TEST(TextureTiles, TheSamePictureInTwoRolesIsFilteredInTwoWays) {
  TexturedScene textured(noise(4, 4, 2));
  const BuiltScene built =
      textured.build({{"pbrMetallicRoughness",
                       {{"baseColorTexture", {{"index", 0}}}, {"metallicRoughnessTexture", {{"index", 0}}}}}});
  ASSERT_EQ(built.scene.textures.size(), 2u);
  const Material& material = built.scene.materials[0];
  const Texture& color = built.scene.textures[material.base_color_texture.texture];
  const Texture& linear = built.scene.textures[material.metallic_roughness_texture.texture];
  EXPECT_EQ(color.srgb, 1);
  EXPECT_EQ(linear.srgb, 0);
  EXPECT_EQ(read_tile(built.scene, color.first_page[0]), read_tile(built.scene, linear.first_page[0]));
  EXPECT_NE(read_tile(built.scene, color.first_page[2]), read_tile(built.scene, linear.first_page[2]));
}

TEST(TextureTiles, SamplersShareThePagesOfTheirPicture) {
  TexturedScene textured(noise(4, 4, 3));
  textured.scene.json["samplers"] = {{{"wrapS", 33071}, {"wrapT", 33648}, {"magFilter", 9728}}};
  textured.scene.json["textures"].push_back({{"source", 0}, {"sampler", 0}});
  const BuiltScene built = textured.build({{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}},
                                           {"emissiveFactor", {1, 1, 1}},
                                           {"emissiveTexture", {{"index", 1}}}});
  ASSERT_EQ(built.scene.textures.size(), 2u);
  const Texture& emissive = built.scene.textures[built.scene.materials[0].emissive_texture.texture];
  EXPECT_EQ(emissive.first_page[0], built.scene.textures[0].first_page[0]);
  EXPECT_EQ(emissive.wrap_u, WrapMode::kClampToEdge);
  EXPECT_EQ(emissive.wrap_v, WrapMode::kMirroredRepeat);
  EXPECT_EQ(emissive.nearest, 1);
  EXPECT_EQ(built.scene.textures[0].wrap_u, WrapMode::kRepeat);
}

TEST(TextureTiles, EmissionWeighsTheMeanOfItsTexture) {
  TexturedScene textured({2, 1, false, {255, 255, 255, 255, 0, 188, 0, 255}});
  const BuiltScene built = textured.build({{"emissiveFactor", {0.5, 1, 0}}, {"emissiveTexture", {{"index", 0}}}});
  const double expected = 0.2126 * 0.5 * 0.5 + 0.7152 * (1 + decode(188)) / 2;
  EXPECT_NEAR(built.scene.materials[0].emission_weight, expected, 1e-5);
  EXPECT_EQ(built.scene.emitters.size(), 1u);
}

TEST(TextureTiles, ABlackEmissiveTextureIsNoLight) {
  TexturedScene textured({1, 1, false, {0, 0, 0, 255}});
  const BuiltScene built = textured.build({{"emissiveFactor", {1, 1, 1}}, {"emissiveTexture", {{"index", 0}}}});
  EXPECT_TRUE(built.scene.emitters.empty());
}

TEST(TextureTiles, WhatAZeroFactorSilencesIsNotStored) {
  TexturedScene textured(noise(4, 4, 4));
  const BuiltScene built = textured.build(
      {{"pbrMetallicRoughness",
        {{"metallicFactor", 0}, {"roughnessFactor", 0}, {"metallicRoughnessTexture", {{"index", 0}}}}},
       {"emissiveTexture", {{"index", 0}}}});
  EXPECT_TRUE(built.scene.textures.empty());
  EXPECT_EQ(built.scene.header.texture_bytes, 0u);
}

TEST(TextureTiles, AlphaThatIsOneEverywhereIsNoCoverage) {
  TexturedScene opaque({1, 2, true, {1, 2, 3, 255, 4, 5, 6, 255}});
  const nlohmann::json blend = {{"alphaMode", "BLEND"},
                                {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}};
  const BuiltScene solid = opaque.build(blend);
  EXPECT_EQ(solid.scene.materials[0].coverage, CoverageMode::kOpaque);
  EXPECT_FALSE(solid.objects[0][0].coverage.has_value());
  TexturedScene holed({1, 2, true, {1, 2, 3, 255, 4, 5, 6, 254}});
  const BuiltScene see_through = holed.build(blend);
  EXPECT_EQ(see_through.scene.materials[0].coverage, CoverageMode::kBlend);
  ASSERT_TRUE(see_through.objects[0][0].coverage.has_value());
  EXPECT_NE(std::count(see_through.objects[0][0].texels.begin(), see_through.objects[0][0].texels.end(), 254), 0);
}

}  // namespace
}  // namespace shoal::testing
