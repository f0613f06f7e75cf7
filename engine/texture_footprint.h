// The level of a texture that a vertex is shaded with. The cone of its ray (engine/ray_cone.h) meets the surface in an
// ellipse; in a texture's texels that is another ellipse, and the level is the one whose texels are about as large as its
// shorter axis (but a texel is never below an eighth of the longer one). What the longer axis spans is left to the
// samples of the pixel, which differ in it. Between two levels one is drawn with the chance of its nearness, so that a
// look-up reads four texels and its mean is that of a trilinear one (Pharr et al. 2024, "Filtering After Shading With
// Stochastic Texture Filtering").
//
// Called by engine/shade and engine/material_sample; only of scenes with textures. Pure; about 30 ns a vertex and 10 ns
// a look-up.
#pragma once

#include "engine/ray_cone.h"
#include "engine/scene_tables.h"
#include "engine/surface.h"

namespace shoal {

enum class TextureFilter : uint8_t {
  kMip,       ///< the level by the ray's cone
  kBilinear,  ///< level 0, whatever the distance
};

class TextureFootprint {
 public:
  /// `width` of the cone at the surface; `choice` in [0, 1) draws between two levels, the same for all textures.
  /// Keeps a reference to the surface.
  TextureFootprint(const Surface& surface, float width, float choice);

  /// The level of `texture` to look up; 0 where the footprint is not defined (no area, no normal, no such uv set).
  /// `transform`: TextureTransform::m or null.
  uint32_t level(const Texture& texture, uint32_t uv_set, const float* transform) const;

 private:
  const Surface& surface_;
  float choice_;
  /// The axes of the ellipse as (b1, b2), barycentrics of the triangle; zero when it is not defined.
  glm::dvec2 across_{0}, along_{0};
};

/// log2 by the exponent and a straight line between powers of two: at most 0.087 too small. Requires: v >= 1.
float rough_log2(float v);

}  // namespace shoal
