// Where the builder of treelets finds coverage: the materials' alpha modes, and the alpha channel of every mip
// level of the textures that need it, held in memory during the build only. Filled by engine/tile_textures, read by
// treelets/build_object from any thread once filled. Cost: 4/3 byte a texel of level 0.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/scene_tables.h"
#include "treelets/coverage.h"

namespace shoal {

struct AlphaLevel {
  uint32_t width = 0, height = 0;
  std::vector<uint8_t> alpha;  ///< row by row
};

class CoverageTextures : public CoverageSource {
 public:
  explicit CoverageTextures(size_t texture_count) : levels_(texture_count) {}
  /// Level after level, finest first.
  void add_level(uint32_t texture, AlphaLevel&& level) { levels_[texture].push_back(std::move(level)); }
  /// Requires: every texture of a material that is not opaque has its levels or is opaque.
  void set_materials(const std::vector<Material>& materials, const std::vector<Texture>& textures,
                     const std::vector<TextureTransform>& transforms);
  uint64_t resident_bytes() const;

  MaterialCoverage coverage(uint32_t material) const override { return coverage_[material]; }
  uint32_t level_count(uint32_t texture) const override { return static_cast<uint32_t>(levels_[texture].size()); }
  void level_size(uint32_t texture, uint32_t level, uint32_t* width, uint32_t* height) const override;
  Status read_alpha(uint32_t texture, uint32_t level, uint32_t x, uint32_t y,
                    std::span<uint8_t> out) const override;

 private:
  std::vector<std::vector<AlphaLevel>> levels_;  // empty: opaque
  std::vector<MaterialCoverage> coverage_;
};

}  // namespace shoal
