#include "engine/texture_sample.h"

#include <array>
#include <cmath>

#include "engine/math.h"

namespace shoal {
namespace {

constexpr uint32_t kTile = kTextureTileTexels;

const std::array<float, 256>& srgb_values() {
  static const std::array<float, 256> values = [] {
    std::array<float, 256> table{};
    for (int i = 0; i < 256; ++i) table[i] = srgb_to_linear(static_cast<float>(i) / 255.0f);
    return table;
  }();
  return values;
}

/// Brings a coordinate near the picture before it is multiplied by the size, so that far repeats keep their digits.
float reduce(float u, WrapMode mode) {
  if (!std::isfinite(u)) return 0;
  switch (mode) {
    case WrapMode::kRepeat:
      return u - std::floor(u);
    case WrapMode::kMirroredRepeat:
      return u - 2 * std::floor(0.5f * u);
    case WrapMode::kClampToEdge:
      break;
  }
  return std::clamp(u, 0.0f, 1.0f);
}

PageId tile_page(const Texture& texture, uint32_t x, uint32_t y) {
  const uint32_t tiles_across = (texture.width + kTile - 1) / kTile;
  return texture.first_page[0] + (y / kTile) * tiles_across + x / kTile;
}

}  // namespace

uint32_t wrap_texel(int64_t i, uint32_t size, WrapMode mode) {
  const int64_t n = size;
  switch (mode) {
    case WrapMode::kRepeat:
      return static_cast<uint32_t>((i % n + n) % n);
    case WrapMode::kMirroredRepeat: {
      const int64_t j = (i % (2 * n) + 2 * n) % (2 * n);
      return static_cast<uint32_t>(j < n ? j : 2 * n - 1 - j);
    }
    case WrapMode::kClampToEdge:
      break;
  }
  return static_cast<uint32_t>(std::clamp<int64_t>(i, 0, n - 1));
}

Result<Vec4> TextureSampler::sample(uint32_t index, const Vec2& uv, CacheCounters& counters) {
  const Texture& texture = textures_[index];
  if (texture.width == 0 || texture.height == 0) return Vec4(0, 0, 0, 1);
  const float x = reduce(uv.x, texture.wrap_u) * static_cast<float>(texture.width);
  const float y = reduce(uv.y, texture.wrap_v) * static_cast<float>(texture.height);

  std::array<Tap, 4> taps;
  size_t tap_count = 0;
  const auto add_tap = [&](float column, float row, float weight) {
    if (weight > 0) {
      taps[tap_count++] = {wrap_texel(static_cast<int64_t>(column), texture.width, texture.wrap_u),
                           wrap_texel(static_cast<int64_t>(row), texture.height, texture.wrap_v), weight};
    }
  };
  if (texture.nearest != 0) {
    add_tap(std::floor(x), std::floor(y), 1);
  } else {
    const float column = std::floor(x - 0.5f), row = std::floor(y - 0.5f);
    const float fx = (x - 0.5f) - column, fy = (y - 0.5f) - row;
    add_tap(column, row, (1 - fx) * (1 - fy)), add_tap(column + 1, row, fx * (1 - fy));
    add_tap(column, row + 1, (1 - fx) * fy), add_tap(column + 1, row + 1, fx * fy);
  }

  // Every texel is fetched tile by tile, the pinned one first; the sum is then taken in the order of the taps, so
  // that what is pinned cannot change a bit.
  std::array<Vec4, 4> values;
  unsigned missing = (1u << tap_count) - 1;
  while (missing != 0) {
    bool found = false;
    for (size_t i = 0; i < tap_count; ++i) {
      if ((missing >> i & 1) == 0 || !tile_ || tile_.page() != tile_page(texture, taps[i].x, taps[i].y)) continue;
      values[i] = texel(texture, taps[i].x, taps[i].y), missing &= ~(1u << i), found = true;
    }
    if (missing == 0) break;
    if (!found || missing != 0) {
      size_t next = 0;
      while ((missing >> next & 1) == 0) ++next;
      SHOAL_RETURN_IF_ERROR(pin_tile(tile_page(texture, taps[next].x, taps[next].y), counters));
    }
  }
  Vec4 sum(0);
  for (size_t i = 0; i < tap_count; ++i) sum += values[i] * taps[i].weight;
  return sum;
}

Status TextureSampler::pin_tile(PageId page, CacheCounters& counters) {
  tile_.reset();
  SHOAL_ASSIGN_OR_RETURN(tile_, cache_->pin(page, counters));
  if (tile_.bytes().size() < kTile * kTile * 4) {
    return Error{ErrorCode::kCorrupt, "texture tile, page " + std::to_string(page) + ": expected " +
                                          std::to_string(kTile * kTile * 4) + " bytes, found " +
                                          std::to_string(tile_.bytes().size())};
  }
  return {};
}

Vec4 TextureSampler::texel(const Texture& texture, uint32_t x, uint32_t y) const {
  const std::byte* p = tile_.bytes().data() + ((y % kTile) * kTile + x % kTile) * 4;
  const auto value = [p](int i) { return std::to_integer<uint8_t>(p[i]); };
  const float alpha = static_cast<float>(value(3)) / 255.0f;
  if (texture.srgb != 0) {
    const std::array<float, 256>& linear = srgb_values();
    return {linear[value(0)], linear[value(1)], linear[value(2)], alpha};
  }
  return {static_cast<float>(value(0)) / 255.0f, static_cast<float>(value(1)) / 255.0f,
          static_cast<float>(value(2)) / 255.0f, alpha};
}

}  // namespace shoal
