// A material at a point of a surface: its factors times its textures and the vertex colour. A material without
// textures touches none, and only what it calls for is looked up. Called by engine/shade. A few texture tiles
// stay pinned (engine/texture_sample.h).
#pragma once

#include <span>

#include "engine/layered_bsdf.h"
#include "engine/scene_tables.h"
#include "engine/surface.h"
#include "engine/texture_footprint.h"
#include "engine/texture_sample.h"

namespace shoal {

/// What a look-up needs and counts.
struct TextureContext {
  TextureSampler& textures;
  CacheCounters& cache_counters;
  uint64_t& lookups_count;
  std::span<const TextureTransform> transforms = {};  ///< empty: none is applied
  bool vertex_colors = true;                          ///< false: they are white
  const TextureFootprint* footprint = nullptr;        ///< null: level 0

  /// White when the slot is empty. `uv` is before the slot's transform. Fails with: what the cache returns.
  Result<Vec4> sample(const TextureSlot& slot, const Vec2& uv);
  /// The linear part and offset that the slot's uv are taken through; null: none.
  const float* transform(const TextureSlot& slot) const {
    return slot.transform == 0 || transforms.empty() ? nullptr : transforms[slot.transform - 1u].m;
  }
};

/// Emitted radiance, both sides alike. `uv` is of the emissive texture's set.
Result<Vec3> sample_emission(const Material& material, const Vec2& uv, TextureContext& context);
/// Base colour times texture and vertex colour, in [0, 1], so that no vertex colour makes a surface give off energy.
Result<Vec3> sample_base_color(const Material& material, const Surface& surface, TextureContext& context);
/// The values of the BSDF.
Result<MaterialSample> sample_material(const Material& material, const Surface& surface, TextureContext& context);
/// The normal that a texel of `slot` says, x and y times `scale`, turned to the side seen.
Vec3 normal_of_texel(const Vec4& texel, float scale, const TextureSlot& slot, const Surface& surface,
                     const TextureContext& context);
/// The shading normal, mapped unless `mapped` is false, and turned to the side seen (engine/surface.h).
Result<Vec3> sample_normal(const Material& material, const Surface& surface, TextureContext& context,
                           bool mapped = true);

/// Adds to `sample` the layers that `effects` (MaterialEffects) names.
Status sample_layers(const MaterialLayers& layers, const Material& material, uint32_t effects,
                     const Surface& surface, TextureContext& context, LayeredSample& sample);

}  // namespace shoal
