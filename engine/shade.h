// Shading: what a hit means. Emission with multiple importance sampling, one light sample (a shadow ray with the
// radiance that it would bring), one sampled bounce, Russian roulette. The same function serves every order, so
// all give the same bits. Called by engine/render_*. Any number of threads, one Shader each.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "engine/effects.h"
#include "engine/invalid_samples.h"
#include "engine/light_choice.h"
#include "engine/path_state.h"
#include "engine/ray_birth.h"
#include "engine/sampler.h"
#include "engine/scene.h"
#include "engine/shutter_times.h"
#include "engine/surface_features.h"
#include "engine/texture_footprint.h"
#include "engine/texture_sample.h"
#include "io/page_cache.h"

namespace shoal {

struct LayeredSample;
struct TextureContext;

/// --environment: constant radiance or an equirectangular picture (glTF axes: +y up; u = 0.5 looks along -z).
struct EnvironmentOptions {
  enum class Kind : uint8_t { kNone, kConstant, kImage } kind = Kind::kNone;
  Vec3 radiance{0};
  std::string path;
  float rotation = 0;   ///< degrees, as Environment takes it
  float intensity = 1;  ///< multiplies the radiance
  bool fallback = false;  ///< nobody asked for it: the scene has no light
};

inline constexpr uint64_t kMaxEnvironmentPixels = uint64_t{1} << 26;

struct ShadingOptions {
  /// Scattering events a path may have. Vertex k (PathState::bounce == k; the camera ray's hit is 0) sends a shadow
  /// ray and a bounce only when k < bounces. 0: emission seen by the camera; 1: direct light; 2: one indirect
  /// bounce.
  uint32_t bounces = 8;
  static constexpr uint32_t kNoRoulette = 0xffffffffu;
  uint32_t roulette_start = 3;  ///< the first vertex at which Russian roulette may end a path
  /// The most that one contribution to a path may have in its largest channel; 0: no limit. Light that was scattered once
  /// on its way to the camera is direct, light scattered more often indirect; what is seen directly has no limit.
  float clamp_direct = 0, clamp_indirect = 0;
  SamplerKind sampler = SamplerKind::kSobol;
  uint64_t seed = 0;
  EnvironmentOptions environment;
  LightChoice light_choice = LightChoice::kTree;
  EffectChoice effects;
  TextureFilter texture_filter = TextureFilter::kMip;
  TriangleTest triangle_test = TriangleTest::kWatertight;  ///< what traversal and shading find triangles by
};

/// Tables shared by all threads: light sampling distributions or a tree over the lights (made by `threads`), environment
/// map and its distribution, directional albedo tables. Immutable. Fails with: kInput (environment file).
class ShadingTables {
 public:
  static Result<std::unique_ptr<ShadingTables>> create(FileSystem& fs, const Scene& scene,
                                                       const ShadingOptions& options, unsigned threads = 1);
  ~ShadingTables();
  uint64_t resident_bytes() const;
  bool has_lights() const;  ///< anything a shadow ray could be sent to
  bool has_coverage() const;  ///< a material is there in part

  struct Impl;
  const Impl& impl() const { return *impl_; }

 private:
  explicit ShadingTables(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// What a shaded vertex asks for. Directions need not be normalised; the ray starts at t = 0 (exclusive).
struct ShadeResult {
  bool has_shadow = false;
  Vec3 shadow_origin, shadow_direction;
  float shadow_t_max = 0;  ///< exclusive
  RayBirth shadow_birth = RayBirth::kAreaShadow;
  bool has_bounce = false;
  Vec3 bounce_origin, bounce_direction;
  RayBirth bounce_birth = RayBirth::kDiffuse;
};

struct ShadeCounters {
  uint64_t vertices_shaded_count = 0;
  uint64_t texture_lookups_count = 0;
  uint64_t clamped_samples_count = 0;  ///< contributions that were lowered to a limit
  InvalidSamples invalid;  ///< what was not finite: dropped, counted, reported
};

class Shader {
 public:
  /// Keeps references to scene, tables, options and cache, which serves texture tiles; kPinnedTilesPerThread at most are
  /// pinned. `sampler`: of the options.
  Shader(const Scene& scene, const ShadingTables& tables, const ShadingOptions& options, const Sampler& sampler,
         PageCache& cache);

  /// Shades path.hit. Requires: path.hit.valid(), both rays of the vertex before are home. `geometry` is the hit
  /// treelet's decoded page, `attributes` its attribute page or empty. Adds emission to path.radiance, sets
  /// path.shadow_radiance, and, when a bounce goes on, throughput, bsdf_pdf and ++bounce.
  /// Fails with: what the cache returns.
  Status shade_hit(PathState& path, std::span<const std::byte> geometry, std::span<const std::byte> attributes,
                   ShadeResult& result, ShadeCounters& counters, CacheCounters& cache_counters);
  /// The ray left the scene: adds the environment with MIS.
  void shade_miss(PathState& path, ShadeCounters& counters);
  /// Whether PathState::cone is wanted.
  bool follows_cones() const { return follows_cones_; }
  uint64_t texture_tiles_pinned_count() const { return textures_.tiles_pinned_count(); }
  /// Of the vertex shaded last, if its path sought them (PathState::seeks).
  const SurfaceFeatures& features() const { return features_; }

 private:
  /// Moves path.cone to the surface; what of it textures are looked up for.
  TextureFootprint reach(PathState& path, const Surface& surface) const;
  Status add_emission(PathState& path, const Surface& surface, const Material& material,
                      const TextureContext& vertex, ShadeCounters& counters);
  Status add_unlit(PathState& path, const Surface& surface, const Material& material, TextureContext& textures,
                   ShadeCounters& counters);
  Status shade_lambert(PathState& path, const Surface& surface, const Material& material, ShadeResult& result,
                       TextureContext& textures, ShadeCounters& counters);
  /// Light and bounce of a material with layers; `effects` is what it is shaded with.
  Status shade_layers(PathState& path, const Surface& surface, const Material& material, uint32_t effects,
                      ShadeResult& result, TextureContext& textures, ShadeCounters& counters);
  void disperse(const PathState& path, const MaterialLayers& layers, LayeredSample& values) const;
  /// What the volume that `medium` names lets pass over a distance.
  Vec3 transmittance(uint32_t medium, float distance) const;
  void absorb(PathState& path, const Surface& surface, uint32_t material, uint32_t effects) const;
  /// `medium` is that of the scattered ray, on either side of the surface.
  struct Sides {
    uint32_t above = 0, below = 0;
  };
  template <class AnyBsdf>
  Status sample_light(PathState& path, const Surface& surface, const AnyBsdf& bsdf, const Sides& media,
                      ShadeResult& result, const TextureContext& vertex, ShadeCounters& counters);
  template <class AnyBsdf>
  void sample_bounce(PathState& path, const Surface& surface, const AnyBsdf& bsdf, const Sides& media,
                     ShadeResult& result, ShadeCounters& counters) const;
  Status note_features(const PathState& path, const Surface& surface, const Material& material, uint32_t effects,
                       TextureContext& textures);
  /// Adds light that was scattered so often; clamped, or dropped if it is not finite, and counted.
  void add_light(Vec3& sum, Vec3 light, uint32_t scatterings, InvalidTerm term, const PathState& path,
                 ShadeCounters& counters) const;
  /// Of the vertex that is shaded.
  Random4 random(const PathState& path, Dimension dimension) const {
    return sampler_.draw(path.pixel, path.sample, path.bounce, dimension);
  }
  TextureContext context(ShadeCounters& counters, CacheCounters& cache_counters);
  const MaterialLayers& layers_of(const Material& material) const;
  /// Of the shutter.
  float time_of(const PathState& path) const {
    return times_ == ShutterTimes::kNone ? 0.5f : shoal::time_of(path, sampler_, times_);
  }

  const Scene* scene_;
  const ShadingTables* tables_;
  const ShadingOptions* options_;
  Sampler sampler_;
  std::span<const Material> materials_;
  ShutterTimes times_;
  TextureSampler textures_;
  bool follows_cones_;
  SurfaceFeatures features_;
};

/// The share of light that the mirrors and the glass of a path left, in [0, 1].
Vec3 passed_color(const PathState& path);

}  // namespace shoal
