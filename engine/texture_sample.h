// Texture look-ups through the page cache: level 0, bilinear or nearest, with glTF's wrap modes. uv (0, 0) is the
// upper left corner of the upper left texel, v runs down. sRGB colours become linear before they are interpolated.
// Called by engine/material_sample. One TextureSampler a thread; it keeps the tile read last pinned, never a
// second. Cost: about 40 ns when the four texels lie in the tile that is pinned already.
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

  /// Linear RGBA in [0, 1]; uv that are not finite count as 0. Requires: texture < number of textures.
  /// Fails with: what the cache returns.
  Result<Vec4> sample(uint32_t texture, const Vec2& uv, CacheCounters& counters);

 private:
  struct Tap {
    uint32_t x, y;
    float weight;
  };
  Status pin_tile(PageId page, CacheCounters& counters);
  Vec4 texel(const Texture& texture, uint32_t x, uint32_t y) const;

  std::span<const Texture> textures_;
  PageCache* cache_;
  PagePin tile_;
};

}  // namespace shoal
