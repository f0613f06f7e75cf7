// A material at a point of a surface: its factors times its textures and the vertex colour. A material without
// textures touches none. Called by engine/shade. One texture tile is pinned at a time (engine/texture_sample.h).
#pragma once

#include "engine/bsdf.h"
#include "engine/scene_tables.h"
#include "engine/surface.h"
#include "engine/texture_sample.h"

namespace shoal {

/// What a look-up needs and counts.
struct TextureContext {
  TextureSampler& textures;
  CacheCounters& cache_counters;
  uint64_t& lookups_count;

  /// White when the slot is empty. Fails with: what the cache returns.
  Result<Vec4> sample(const TextureSlot& slot, const Vec2& uv);
};

/// Emitted radiance, both sides alike. `uv` is of the emissive texture's set.
Result<Vec3> sample_emission(const Material& material, const Vec2& uv, TextureContext& context);
/// The values of the BSDF; colours are clamped to [0, 1], so that no vertex colour makes a surface give off energy.
Result<MaterialSample> sample_material(const Material& material, const Surface& surface, TextureContext& context);
/// The shading normal, mapped and turned to the side seen (engine/surface.h).
Result<Vec3> sample_normal(const Material& material, const Surface& surface, TextureContext& context);

}  // namespace shoal
