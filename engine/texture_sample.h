// Texture look-ups through the page cache: in one level, bilinear or nearest, with glTF's wrap modes. uv (0, 0) is the
// upper left corner of the upper left texel, v runs down. sRGB colours become linear before they are interpolated.
// Called by engine/material_sample. One TextureSampler a thread; it keeps the tiles read last
// pinned, kPinnedTilesPerThread at most: those of a material with several textures, and on both sides of a border. Cost: about 40 ns when the four texels lie in the tile that is pinned already.
#pragma once

#include <cstdint>
#include <span>

#include "engine/scene_tables.h"
#include "io/page_cache.h"
#include "io/result.h"
#include "treelets/vector.h"

namespace shoal {

/// The texel, 0 <= result < size, that coordinate `i` of an unwrapped picture names.
uint32_t wrap_texel(int64_t i, uint32_t size, WrapMode mode);

class TextureSampler {
 public:
  TextureSampler(std::span<const Texture> textures, PageCache& cache) : textures_(textures), cache_(&cache) {}

  /// Linear RGBA in [0, 1]; uv that are not finite count as 0. Requires: texture < number of textures, level below
  /// that texture's level_count (0 is always allowed).
  /// Fails with: what the cache returns.
  Result<Vec4> sample(uint32_t texture, const Vec2& uv, uint32_t level, CacheCounters& counters);
  const Texture& texture(uint32_t index) const { return textures_[index]; }
  /// How often another tile was pinned than the one before.
  uint64_t tiles_pinned_count() const { return tiles_pinned_count_; }

 private:
  struct Tap {
    uint32_t x, y;
    float weight;
  };
  /// The texels of a tile that is pinned, or null.
  const std::byte* pinned(PageId page) const;
  /// Pins it in the place of the one that was pinned longest ago.
  Status pin_tile(PageId page, CacheCounters& counters);

  std::span<const Texture> textures_;
  PageCache* cache_;
  PagePin tiles_[kPinnedTilesPerThread];
  uint32_t oldest_ = 0;
  uint64_t tiles_pinned_count_ = 0;
};

}  // namespace shoal
