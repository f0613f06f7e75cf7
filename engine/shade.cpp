#include "engine/shade.h"

#include <cmath>

#include "engine/bsdf.h"
#include "engine/material_sample.h"
#include "engine/sampler.h"
#include "engine/shading_tables.h"
#include "engine/surface.h"

namespace shoal {
namespace {

/// A path is never ended with more than this probability, so that no survivor is lifted by more than its inverse.
constexpr float kMinSurvival = 0.05f;

bool finite(const Vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

/// A contribution that is not finite is dropped and counted.
void add_radiance(Vec3& sum, const Vec3& term, ShadeCounters& counters) {
  if (finite(term)) {
    sum += term;
  } else {
    ++counters.invalid_samples_count;
  }
}

Random4 path_random(const PathState& path, uint64_t seed, Dimension dimension) {
  return random4(seed, path.pixel, path.sample, path.bounce, dimension);
}

/// Two words as one number in [0, 1): enough digits to choose among any number of emitters.
double uniform53(uint32_t high, uint32_t low) {
  return static_cast<double>((static_cast<uint64_t>(high) << 32 | low) >> 11) * 0x1p-53;
}

}  // namespace

Shader::Shader(const Scene& scene, const ShadingTables& tables, const ShadingOptions& options, PageCache& cache)
    : scene_(&scene), tables_(&tables), options_(&options), textures_(scene.textures, cache) {}

Status Shader::shade_hit(PathState& path, std::span<const std::byte> geometry,
                         std::span<const std::byte> attributes, ShadeResult& result, ShadeCounters& counters,
                         CacheCounters& cache_counters) {
  result = {};
  path.shadow_radiance = Vec3(0);
  ++counters.vertices_shaded_count;
  const Surface surface = find_surface(path, scene_->top_tree.instance(path.hit.instance), geometry, attributes);
  const Material& material = scene_->materials[surface.attributes.material];
  if ((material.flags & kMaterialEmits) != 0) {
    SHOAL_RETURN_IF_ERROR(add_emission(path, surface, material, counters, cache_counters));
  }
  if (path.bounce >= options_->bounces) return {};

  TextureContext context{textures_, cache_counters, counters.texture_lookups_count};
  SHOAL_ASSIGN_OR_RETURN(const MaterialSample values, sample_material(material, surface, context));
  SHOAL_ASSIGN_OR_RETURN(const Vec3 normal, sample_normal(material, surface, context));
  const Bsdf bsdf(values, tables_->impl().energy_table(), surface.geometric_normal, normal, surface.wo);
  if (bsdf.black()) return {};
  SHOAL_RETURN_IF_ERROR(sample_light(path, surface, bsdf, result, counters, cache_counters));
  sample_bounce(path, surface, bsdf, result);
  return {};
}

Status Shader::add_emission(PathState& path, const Surface& surface, const Material& material,
                            ShadeCounters& counters, CacheCounters& cache_counters) {
  TextureContext context{textures_, cache_counters, counters.texture_lookups_count};
  SHOAL_ASSIGN_OR_RETURN(const Vec3 emission,
                         sample_emission(material, surface.uv(material.emissive_texture.uv_set), context));
  float weight = 1;
  const double area_pdf = tables_->impl().lights->emitter_pdf(material);
  if (path.bsdf_pdf > 0 && area_pdf > 0) {
    const glm::dvec3 along = glm::dvec3(surface.position.point) - glm::dvec3(path.origin);
    const double cosine = glm::dot(surface.geometric_normal, surface.wo);
    weight = cosine > 0 ? mis_weight(path.bsdf_pdf, area_pdf * glm::dot(along, along) / cosine) : 0.0f;
  }
  add_radiance(path.radiance, path.throughput * emission * weight, counters);
  return {};
}

Status Shader::sample_light(PathState& path, const Surface& surface, const Bsdf& bsdf, ShadeResult& result,
                            ShadeCounters& counters, CacheCounters& cache_counters) {
  const LightSampler& lights = *tables_->impl().lights;
  if (lights.empty()) return {};
  const Random4 random = path_random(path, options_->seed, Dimension::kLight);
  const LightSample light = lights.sample(
      surface.position.point, {uniform53(random.bits[0], random.bits[3]), random.uniform(1), random.uniform(2)});
  if (!(light.pdf > 0)) return {};
  const BsdfValue f = bsdf.evaluate(light.direction);
  if (f.value == Vec3(0)) return {};

  Vec3 radiance = light.radiance;
  if (light.emitter != nullptr) {
    TextureContext context{textures_, cache_counters, counters.texture_lookups_count};
    SHOAL_ASSIGN_OR_RETURN(const Vec3 emission,
                           sample_emission(scene_->materials[light.emitter->material], light.emitter_uv, context));
    radiance *= emission;
  }
  const float weight = light.delta ? 1.0f : mis_weight(light.pdf, f.pdf);
  add_radiance(path.shadow_radiance, path.throughput * f.value * radiance * static_cast<float>(weight / light.pdf),
               counters);
  if (path.shadow_radiance == Vec3(0)) return {};

  result.has_shadow = true;
  result.shadow_origin = offset_point(surface.position, surface.geometric_normal);
  if (light.at_infinity) {
    result.shadow_direction = light.direction;
    result.shadow_t_max = kRayInfinity;
    return {};
  }
  // The ray ends at t = 1, just before the emitter.
  const BoundedPoint target = ray_end(light.target, result.shadow_origin, light.instance);
  result.shadow_direction = offset_point(target, light.target_normal) - result.shadow_origin;
  result.shadow_t_max = 1;
  return {};
}

void Shader::sample_bounce(PathState& path, const Surface& surface, const Bsdf& bsdf, ShadeResult& result) const {
  // After the last scattering a bounce can only find emission.
  if (path.bounce + 1 >= options_->bounces && !tables_->impl().lights_hit_by_chance) return;
  const Random4 random = path_random(path, options_->seed, Dimension::kBsdf);
  const BsdfSample sample = bsdf.sample(random.uniform(0), random.uniform(1), random.uniform(2));
  Vec3 throughput = path.throughput * sample.weight;
  if (!(sample.pdf > 0) || !finite(throughput) || throughput == Vec3(0)) return;
  if (path.bounce >= options_->roulette_start) {
    const float survival = std::clamp(max_component(throughput), kMinSurvival, 1.0f);
    if (path_random(path, options_->seed, Dimension::kRoulette).uniform(0) >= survival) return;
    throughput /= survival;
  }
  path.throughput = throughput;
  path.bsdf_pdf = sample.pdf;
  ++path.bounce;
  result.has_bounce = true;
  result.bounce_origin = offset_point(surface.position, surface.geometric_normal);
  result.bounce_direction = sample.direction;
}

void Shader::shade_miss(PathState& path, ShadeCounters& counters) {
  const ShadingTables::Impl& tables = tables_->impl();
  if (tables.environment.black()) return;
  const Vec3 direction = glm::normalize(path.direction);
  float weight = 1;
  if (path.bsdf_pdf > 0) weight = mis_weight(path.bsdf_pdf, tables.lights->environment_pdf(direction));
  add_radiance(path.radiance, path.throughput * tables.environment.radiance(direction) * weight, counters);
}

}  // namespace shoal
