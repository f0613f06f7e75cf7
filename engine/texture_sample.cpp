#include "engine/texture_sample.h"

#include <array>
#include <cmath>

#include "engine/math.h"
#include "engine/mip_pyramid.h"

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

/// One level of a texture.
struct LevelTiles {
  uint32_t width, height;
  PageId first_page;

  PageId page(uint32_t x, uint32_t y) const {
    const uint32_t tiles_across = (width + kTile - 1) / kTile;
    return first_page + (y / kTile) * tiles_across + x / kTile;
  }
};

Vec4 texel(const std::byte* tile, bool srgb, uint32_t x, uint32_t y) {
  const std::byte* p = tile + ((y % kTile) * kTile + x % kTile) * 4;
  const auto value = [p](int i) { return std::to_integer<uint8_t>(p[i]); };
  const float alpha = static_cast<float>(value(3)) / 255.0f;
  if (srgb) {
    const std::array<float, 256>& linear = srgb_values();
    return {linear[value(0)], linear[value(1)], linear[value(2)], alpha};
  }
  return {static_cast<float>(value(0)) / 255.0f, static_cast<float>(value(1)) / 255.0f,
          static_cast<float>(value(2)) / 255.0f, alpha};
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

Result<Vec4> TextureSampler::sample(uint32_t index, const Vec2& uv, uint32_t level, CacheCounters& counters) {
  const Texture& texture = textures_[index];
  if (texture.width == 0 || texture.height == 0) return Vec4(0, 0, 0, 1);
  const LevelTiles tiles{level_side(texture.width, level), level_side(texture.height, level),
                         texture.first_page[level]};
  const float x = reduce(uv.x, texture.wrap_u) * static_cast<float>(tiles.width);
  const float y = reduce(uv.y, texture.wrap_v) * static_cast<float>(tiles.height);

  std::array<Tap, 4> taps;
  size_t tap_count = 0;
  const auto add_tap = [&](float column, float row, float weight) {
    if (weight > 0) {
      taps[tap_count++] = {wrap_texel(static_cast<int64_t>(column), tiles.width, texture.wrap_u),
                           wrap_texel(static_cast<int64_t>(row), tiles.height, texture.wrap_v), weight};
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

  Vec4 sum(0);
  for (size_t i = 0; i < tap_count; ++i) {
    const PageId page = tiles.page(taps[i].x, taps[i].y);
    const std::byte* tile = pinned(page);
    if (tile == nullptr) {
      SHOAL_RETURN_IF_ERROR(pin_tile(page, counters));
      tile = pinned(page);
    }
    sum += texel(tile, texture.srgb != 0, taps[i].x, taps[i].y) * taps[i].weight;
  }
  return sum;
}

const std::byte* TextureSampler::pinned(PageId page) const {
  for (const PagePin& tile : tiles_) {
    if (tile && tile.page() == page) return tile.bytes().data();
  }
  return nullptr;
}

Status TextureSampler::pin_tile(PageId page, CacheCounters& counters) {
  PagePin& tile = tiles_[oldest_];
  oldest_ = (oldest_ + 1) % kPinnedTilesPerThread;
  tile.reset();
  ++tiles_pinned_count_;
  SHOAL_ASSIGN_OR_RETURN(tile, cache_->pin(page, counters));
  if (tile.bytes().size() < kTile * kTile * 4) {
    const size_t found = tile.bytes().size();
    tile.reset();
    return Error{ErrorCode::kCorrupt, "texture tile, page " + std::to_string(page) + ": expected " +
                                          std::to_string(kTile * kTile * 4) + " bytes, found " +
                                          std::to_string(found)};
  }
  return {};
}

}  // namespace shoal
