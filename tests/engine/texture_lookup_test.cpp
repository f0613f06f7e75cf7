// Texture look-ups against direct formulas on the texels, across tiles, wraps and encodings.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "engine/math.h"
#include "engine/texture_sample.h"
#include "tests/support/shading_scene.h"

namespace shoal {
namespace {

using namespace testing;

std::vector<uint8_t> random_texels(uint32_t width, uint32_t height) {
  std::mt19937 random(5);
  std::vector<uint8_t> texels(size_t{4} * width * height);
  for (uint8_t& t : texels) t = static_cast<uint8_t>(random() & 255);
  return texels;
}

ShadingScene empty_scene() {
  TriangleSoup soup;
  add_rectangle(soup, {0, 0, 0}, {1, 0, 0}, {0, 0, 1}, 0);
  return ShadingScene(std::move(soup), {matte(Vec3(1))});
}

/// One wrapped coordinate, spelled out.
uint32_t wrapped(int64_t i, int64_t n, WrapMode mode) {
  while (mode != WrapMode::kClampToEdge && i < 0) i += 2 * n;
  if (mode == WrapMode::kRepeat) return static_cast<uint32_t>(i % n);
  if (mode == WrapMode::kMirroredRepeat) return static_cast<uint32_t>(i % (2 * n) < n ? i % n : n - 1 - i % n);
  return static_cast<uint32_t>(i < 0 ? 0 : i >= n ? n - 1 : i);
}

double reference(const std::vector<uint8_t>& texels, const Texture& t, double u, double v, uint32_t channel) {
  const double x = u * t.width - 0.5, y = v * t.height - 0.5;
  double sum = 0;
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 2; ++i) {
      const double wx = i ? x - std::floor(x) : 1 - (x - std::floor(x));
      const double wy = j ? y - std::floor(y) : 1 - (y - std::floor(y));
      const size_t column = wrapped(static_cast<int64_t>(std::floor(x)) + i, t.width, t.wrap_u);
      const size_t row = wrapped(static_cast<int64_t>(std::floor(y)) + j, t.height, t.wrap_v);
      const double value = texels[(row * t.width + column) * 4 + channel] / 255.0;
      sum += wx * wy * (t.srgb && channel < 3 ? srgb_to_linear(static_cast<float>(value)) : value);
    }
  }
  return sum;
}

TEST(TextureLookup, IsBilinearUnderEveryWrapModeAndEncoding) {
  constexpr uint32_t kWidth = 150, kHeight = 67;  // three tiles by two, the last ones partly filled
  const std::vector<uint8_t> texels = random_texels(kWidth, kHeight);
  for (const bool srgb : {false, true}) {
    for (const WrapMode mode : {WrapMode::kRepeat, WrapMode::kMirroredRepeat, WrapMode::kClampToEdge}) {
      ShadingScene s = empty_scene();
      const uint32_t index = s.add_texture(kWidth, kHeight, texels, srgb);
      Texture& texture = s.scene.textures[index];
      texture.wrap_u = mode, texture.wrap_v = WrapMode::kRepeat;
      s.prepare({});
      TextureSampler sampler(s.scene.textures, *s.cache);
      std::mt19937 random(1);
      std::uniform_real_distribution<float> uniform(-2.5f, 3.5f);
      for (int i = 0; i < 3000; ++i) {
        const Vec2 uv(uniform(random), uniform(random));
        const Result<Vec4> found = sampler.sample(index, uv, 0, s.cache_counters);
        ASSERT_TRUE(found.ok());
        for (uint32_t c = 0; c < 4; ++c) {
          ASSERT_NEAR(found.value()[static_cast<int>(c)], reference(texels, texture, uv.x, uv.y, c), 2e-4)
              << uv.x << " " << uv.y;
        }
      }
    }
  }
}

TEST(TextureLookup, TheOriginIsTheUpperLeftCornerAndNearestTakesOneTexel) {
  ShadingScene s = empty_scene();
  std::vector<uint8_t> texels(16 * 2 * 4, 0);
  texels[0] = 255;                  // column 0 of the upper row
  texels[(16 + 15) * 4 + 1] = 255;  // column 15 of the lower row
  const uint32_t index = s.add_texture(16, 2, texels, false);
  s.scene.textures[index].nearest = 1;
  s.prepare({});
  TextureSampler sampler(s.scene.textures, *s.cache);
  EXPECT_EQ(sampler.sample(index, {0.001f, 0.001f}, 0, s.cache_counters).value().x, 1);
  EXPECT_EQ(sampler.sample(index, {0.999f, 0.999f}, 0, s.cache_counters).value().y, 1);
  EXPECT_EQ(sampler.sample(index, {0.999f, 0.001f}, 0, s.cache_counters).value(), Vec4(0));
}

TEST(TextureLookup, CoordinatesThatAreNotFiniteAreHarmless) {
  ShadingScene s = empty_scene();
  const uint32_t index = s.add_texture(70, 70, random_texels(70, 70), true);
  s.prepare({});
  TextureSampler sampler(s.scene.textures, *s.cache);
  const float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  for (const float u : {inf, -inf, nan, 3e38f, -3e38f, 1e-45f, -1e-45f, 16777217.0f}) {
    for (const WrapMode mode : {WrapMode::kRepeat, WrapMode::kMirroredRepeat, WrapMode::kClampToEdge}) {
      s.scene.textures[index].wrap_u = s.scene.textures[index].wrap_v = mode;
      const Result<Vec4> found = sampler.sample(index, {u, u}, 0, s.cache_counters);
      ASSERT_TRUE(found.ok());
      EXPECT_TRUE(found.value().x >= 0 && found.value().x <= 1);
    }
  }
}

TEST(TextureLookup, KeepsAFewTilesPinnedAndNeverMore) {
  ShadingScene s = empty_scene();
  constexpr uint32_t kSide = 4 * kTextureTileTexels;  // 16 tiles
  const uint32_t index = s.add_texture(kSide, kSide, random_texels(kSide, kSide), false);
  s.cache_bytes = kPinnedTilesPerThread * kTextureTileTexels * kTextureTileTexels * 4;
  s.prepare({});
  TextureSampler sampler(s.scene.textures, *s.cache);
  ASSERT_TRUE(sampler.sample(index, {0.5f, 0.5f}, 0, s.cache_counters).ok());  // the corner of four tiles
  EXPECT_EQ(s.cache_counters.page_requests_count, 4);
  ASSERT_TRUE(sampler.sample(index, {0.7f, 0.7f}, 0, s.cache_counters).ok());
  EXPECT_EQ(s.cache_counters.page_requests_count, 4);  // of the tiles pinned before
  EXPECT_EQ(sampler.tiles_pinned_count(), 4u);
  for (uint32_t tile = 0; tile < 16; ++tile) {  // a ninth pin would wait for ever
    const Vec2 middle((static_cast<float>(tile % 4) + 0.5f) / 4, (static_cast<float>(tile / 4) + 0.5f) / 4);
    ASSERT_TRUE(sampler.sample(index, middle, 0, s.cache_counters).ok());
  }
  EXPECT_EQ(sampler.tiles_pinned_count(), s.cache_counters.page_requests_count);
}

TEST(TextureLookup, ATileThatIsTooShortIsCorrupt) {
  ShadingScene s = empty_scene();
  s.scene.textures.push_back({});
  s.scene.textures[0].width = s.scene.textures[0].height = 4, s.scene.textures[0].first_page[0] = 0;
  s.prepare({});  // page 0 is a stub of 64 bytes
  TextureSampler sampler(s.scene.textures, *s.cache);
  const Result<Vec4> found = sampler.sample(0, {0.5f, 0.5f}, 0, s.cache_counters);
  ASSERT_FALSE(found.ok());
  EXPECT_EQ(found.error().code, ErrorCode::kCorrupt);
}

TEST(TextureLookup, ReadsTheLevelAskedForAtItsOwnSize) {
  // 150 x 67 and its half, rounded down: other texels, so that levels cannot be mistaken for each other.
  ShadingScene s = empty_scene();
  const uint32_t index = s.add_texture(150, 67, random_texels(150, 67), true);
  std::vector<uint8_t> coarse = random_texels(75, 33);
  for (uint8_t& t : coarse) t = static_cast<uint8_t>(255 - t);
  const uint32_t half = s.add_texture(75, 33, coarse, true);
  s.scene.textures[index].level_count = 2;
  s.scene.textures[index].first_page[1] = s.scene.textures[half].first_page[0];
  s.prepare({});
  TextureSampler sampler(s.scene.textures, *s.cache);
  for (float u = -0.5f; u < 1.5f; u += 0.07f) {
    const Vec2 uv(u, 1.1f - u);
    const Vec4 found = sampler.sample(index, uv, 1, s.cache_counters).value();
    EXPECT_EQ(found, sampler.sample(half, uv, 0, s.cache_counters).value());
    EXPECT_NE(found, sampler.sample(index, uv, 0, s.cache_counters).value());
  }
}

}  // namespace
}  // namespace shoal
