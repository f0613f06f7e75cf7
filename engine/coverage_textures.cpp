#include "engine/coverage_textures.h"

#include <algorithm>

namespace shoal {

void CoverageTextures::set_materials(const std::vector<Material>& materials, const std::vector<Texture>& textures,
                                     const std::vector<TextureTransform>& transforms) {
  coverage_.clear();
  for (const Material& material : materials) {
    MaterialCoverage c;
    c.mode = material.coverage;
    c.factor = material.base_color[3];
    c.cutoff = material.alpha_cutoff;
    const uint32_t texture = material.base_color_texture.texture;
    if (c.mode != CoverageMode::kOpaque && texture != kNoIndex && !levels_[texture].empty()) {
      c.texture = texture;
      c.uv_set = material.base_color_texture.uv_set;
      c.wrap_u = textures[texture].wrap_u, c.wrap_v = textures[texture].wrap_v;
      c.nearest = textures[texture].nearest != 0;
      if (const uint16_t row = material.base_color_texture.transform; row != 0) {
        c.transformed = true;
        std::copy_n(transforms[row - 1].m, 6, c.uv_transform);
      }
    }
    coverage_.push_back(c);
  }
}

uint64_t CoverageTextures::resident_bytes() const {
  uint64_t bytes = 0;
  for (const auto& levels : levels_) {
    for (const AlphaLevel& level : levels) bytes += level.alpha.size();
  }
  return bytes;
}

void CoverageTextures::level_size(uint32_t texture, uint32_t level, uint32_t* width, uint32_t* height) const {
  *width = levels_[texture][level].width;
  *height = levels_[texture][level].height;
}

Status CoverageTextures::read_alpha(uint32_t texture, uint32_t level, uint32_t x, uint32_t y,
                                    std::span<uint8_t> out) const {
  const AlphaLevel& l = levels_[texture][level];
  SHOAL_CHECK(y < l.height && uint64_t{x} + out.size() <= l.width);
  std::copy_n(l.alpha.begin() + static_cast<ptrdiff_t>(size_t{y} * l.width + x), out.size(), out.begin());
  return {};
}

}  // namespace shoal
