#include "engine/shade.h"

#include <cmath>
#include <optional>

#include "engine/bsdf.h"
#include "engine/dispersion.h"
#include "engine/lambert_bsdf.h"
#include "engine/material_sample.h"
#include "engine/math.h"
#include "engine/shading_tables.h"
#include "engine/surface.h"
#include "treelets/moving_instance.h"

namespace shoal {
namespace {

/// Set by a build that bench/effects_price compares with: all but Lambert's surfaces and emission is compiled out.
#ifdef SHOAL_ONLY_LAMBERT
constexpr bool kOnlyLambert = true;
#else
constexpr bool kOnlyLambert = false;
#endif

/// A path is never ended with more than this probability, so that no survivor is lifted by more than its inverse.
constexpr float kMinSurvival = 0.05f;

bool finite(const Vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

/// A surface that scatters nothing because some of its values are no numbers.
void count_invalid_surface(const MaterialSample& values, const Vec3& normal, const PathState& path,
                           ShadeCounters& counters) {
  const bool numbers = finite(values.base_color) && finite(values.specular_color) && finite(normal) &&
                       std::isfinite(values.roughness + values.metallic + values.specular);
  if (!numbers) counters.invalid.add(InvalidTerm::kSurface, path);
}

/// Also of what is so large or small that its squares are no floats.
float distance_of(const Vec3& a, const Vec3& b) {
  const float length = glm::length(a - b);
  return length > 0x1p-60f && length < 0x1p60f ? length : static_cast<float>(glm::length(glm::dvec3(a) - glm::dvec3(b)));
}

/// Two words as one number in [0, 1): enough digits to choose among any number of emitters.
double uniform53(uint32_t high, uint32_t low) {
  return static_cast<double>((static_cast<uint64_t>(high) << 32 | low) >> 11) * 0x1p-53;
}

/// The normal on the side of the surface that `direction` leaves to.
template <class AnyBsdf>
Vec3 side_of(const Vec3& normal, const Vec3& direction) {
  if constexpr (AnyBsdf::kTransmits) return glm::dot(normal, direction) < 0 ? -normal : normal;
  return normal;
}

/// LightReceiver::side: light must come from above the geometric normal, unless it may pass. As a code, so that a path
/// can carry it to the next vertex, where the chance of the light that it hits is asked for.
template <class AnyBsdf>
uint32_t light_side(const Surface& surface, const AnyBsdf& bsdf) {
  return bsdf.transmits() ? 0 : encode_direction(surface.geometric_normal);
}

/// Where the shadow ray to a light ends, at a time of the shutter.
BoundedPoint shadow_end(const LightSample& light, const Vec3& origin, float time) {
  if (light.instance == nullptr || !light.instance->moves()) return ray_end(light.target, origin, light.instance);
  const Instance now = instance_at(*light.instance, time);
  return ray_end(light.target, origin, &now);
}

bool wants_cones(const Scene& scene, const ShadingOptions& options) {
  const uint32_t called = scene.textures.empty() ? 0 : uint32_t{kEffectTextures};
  return (options.effects.of(called) & kEffectTextures) != 0 && options.texture_filter == TextureFilter::kMip;
}

}  // namespace

Shader::Shader(const Scene& scene, const ShadingTables& tables, const ShadingOptions& options,
               const Sampler& sampler, PageCache& cache)
    : scene_(&scene),
      tables_(&tables),
      options_(&options),
      sampler_(sampler),
      materials_(tables.impl().materials.materials()),
      times_(shutter_times(scene.top_tree, options.effects)),
      textures_(scene.textures, cache),
      follows_cones_(!kOnlyLambert && wants_cones(scene, options)) {}

void Shader::add_light(Vec3& sum, Vec3 light, uint32_t scatterings, InvalidTerm term, const PathState& path,
                       ShadeCounters& counters) const {
  if (!finite(light)) {
    counters.invalid.add(term, path);
    return;
  }
  const float limit = scatterings > 1 ? options_->clamp_indirect : options_->clamp_direct;
  if (limit > 0 && scatterings > 0 && max_component(light) > limit) {
    light *= limit / max_component(light);  // all channels alike: the hue stays
    ++counters.clamped_samples_count;
  }
  sum += light;
}

Status Shader::shade_hit(PathState& path, std::span<const std::byte> geometry,
                         std::span<const std::byte> attributes, ShadeResult& result, ShadeCounters& counters,
                         CacheCounters& cache_counters) {
  result = {};
  path.shadow_radiance = Vec3(0);
  ++counters.vertices_shaded_count;
  const Instance& instance = scene_->top_tree.instance(path.hit.instance);
  const TriangleTest test = options_->triangle_test;
  const Surface surface =
      instance.moves() ? find_surface(path, instance_at(instance, time_of(path)), geometry, attributes, test)
                       : find_surface(path, instance, geometry, attributes, test);
  const Material& material = materials_[surface.attributes.material];
  const uint32_t effects = kOnlyLambert ? 0 : options_->effects.of(material.effects);
  if (!kOnlyLambert && ((path.medium & kPathMediumMask) | (effects & kEffectVolume)) != 0) {
    absorb(path, surface, surface.attributes.material, effects);
  }
  std::optional<TextureFootprint> footprint;
  if (!kOnlyLambert && follows_cones_) footprint.emplace(reach(path, surface));
  TextureContext textures = context(counters, cache_counters);
  if (footprint) textures.footprint = &*footprint;
  if (!kOnlyLambert && path.seeks != 0) {
    SHOAL_RETURN_IF_ERROR(note_features(path, surface, material, effects, textures));
  }
  if (!kOnlyLambert && (effects & material.effects & kEffectUnlit) != 0) {
    return add_unlit(path, surface, material, textures, counters);
  }
  if ((material.flags & kMaterialEmits) != 0) {
    SHOAL_RETURN_IF_ERROR(add_emission(path, surface, material, textures, counters));
  }
  if (path.bounce >= options_->bounces) return {};
  if (kOnlyLambert || ((material.flags & kMaterialLambert) != 0 && effects == 0)) {
    return shade_lambert(path, surface, material, result, textures, counters);
  }
  if ((effects & kLayerEffects) != 0) {
    return shade_layers(path, surface, material, effects, result, textures, counters);
  }

  const bool mapped = (options_->effects.off & kEffectNormalMap) == 0;
  SHOAL_ASSIGN_OR_RETURN(const MaterialSample values, sample_material(material, surface, textures));
  SHOAL_ASSIGN_OR_RETURN(const Vec3 normal, sample_normal(material, surface, textures, mapped));
  const Bsdf bsdf(values, tables_->impl().energy_table(), surface.geometric_normal, normal, surface.wo);
  if (bsdf.black()) {
    count_invalid_surface(values, normal, path, counters);
    return {};
  }
  const Sides media{path.medium & kPathMediumMask, 0};
  SHOAL_RETURN_IF_ERROR(sample_light(path, surface, bsdf, media, result, textures, counters));
  sample_bounce(path, surface, bsdf, media, result, counters);
  return {};
}

Status Shader::shade_lambert(PathState& path, const Surface& surface, const Material& material, ShadeResult& result,
                             TextureContext& textures, ShadeCounters& counters) {
  const Vec3 factor(material.base_color[0], material.base_color[1], material.base_color[2]);
  const Vec3 color = glm::clamp(factor * (textures.vertex_colors ? Vec3(surface.color()) : Vec3(1)), 0.0f, 1.0f);
  const Vec3 normal = facing_normal(surface, surface.front_normal);
  const LambertBsdf bsdf(color, surface.geometric_normal, normal, surface.wo);
  if (bsdf.black()) {
    count_invalid_surface({.base_color = color}, normal, path, counters);
    return {};
  }
  const Sides media{path.medium & kPathMediumMask, 0};
  SHOAL_RETURN_IF_ERROR(sample_light(path, surface, bsdf, media, result, textures, counters));
  sample_bounce(path, surface, bsdf, media, result, counters);
  return {};
}

TextureContext Shader::context(ShadeCounters& counters, CacheCounters& cache_counters) {
  const bool moved = (options_->effects.off & kEffectTextureTransform) == 0;
  return {textures_, cache_counters, counters.texture_lookups_count,
          moved ? std::span<const TextureTransform>(scene_->texture_transforms) : std::span<const TextureTransform>(),
          (options_->effects.off & kEffectVertexColors) == 0};
}

TextureFootprint Shader::reach(PathState& path, const Surface& surface) const {
  const RayCone cone = unpack_cone(path.cone);
  const float width = cone.width + cone.spread * distance_of(surface.position.point, path.origin);
  path.cone = pack_cone({width, cone.spread});
  return {surface, width, random(path, Dimension::kTexture).uniform(0)};
}

Status Shader::add_emission(PathState& path, const Surface& surface, const Material& material,
                            const TextureContext& vertex, ShadeCounters& counters) {
  TextureContext textures = vertex;
  // Light samples see level 0, and the weights below are of one and the same emission.
  if (path.bsdf_pdf > 0) textures.footprint = nullptr;
  SHOAL_ASSIGN_OR_RETURN(const Vec3 emission,
                         sample_emission(material, surface.uv(material.emissive_texture.uv_set), textures));
  float weight = 1;
  double area_pdf = 0;  // the camera draws no light
  if (path.bsdf_pdf > 0) {
    area_pdf = tables_->impl().lights->emitter_pdf(material, path.hit, {path.origin, path.light_side}, time_of(path));
  }
  if (area_pdf > 0) {
    const glm::dvec3 along = glm::dvec3(surface.position.point) - glm::dvec3(path.origin);
    const double cosine = glm::dot(surface.geometric_normal, surface.wo);
    weight = cosine > 0 ? mis_weight(path.bsdf_pdf, area_pdf * glm::dot(along, along) / cosine) : 0.0f;
  }
  add_light(path.radiance, path.throughput * emission * weight, path.bounce, InvalidTerm::kEmission, path, counters);
  return {};
}

template <class AnyBsdf>
Status Shader::sample_light(PathState& path, const Surface& surface, const AnyBsdf& bsdf, const Sides& media,
                            ShadeResult& result, const TextureContext& vertex, ShadeCounters& counters) {
  const LightSampler& lights = *tables_->impl().lights;
  if (lights.empty()) return {};
  const Random4 drawn = random(path, Dimension::kLight);
  LightReceiver receiver;
  if (lights.has_tree()) {
    receiver = {offset_point(surface.position, surface.geometric_normal), light_side(surface, bsdf)};
  }
  const LightSample light =
      lights.sample(surface.position.point, receiver,
                    {uniform53(drawn.bits[0], drawn.bits[3]), drawn.uniform(1), drawn.uniform(2)}, time_of(path));
  if (!(light.pdf > 0)) {
    if (std::isnan(light.pdf)) counters.invalid.add(InvalidTerm::kLight, path);
    return {};
  }
  const BsdfValue f = bsdf.evaluate(light.direction);
  if (f.value == Vec3(0)) return {};

  Vec3 radiance = light.radiance;
  if (light.emitter != nullptr) {
    TextureContext textures = vertex;
    textures.footprint = nullptr;  // which is of another surface
    SHOAL_ASSIGN_OR_RETURN(const Vec3 emission,
                           sample_emission(materials_[light.emitter->material], light.emitter_uv, textures));
    radiance *= emission;
  }
  const Vec3 side = side_of<AnyBsdf>(surface.geometric_normal, light.direction);
  const uint32_t medium = side == surface.geometric_normal ? media.above : media.below;
  if (medium != 0 && !light.at_infinity) {
    radiance *= transmittance(medium, distance_of(light.target.point, surface.position.point));
  }
  const float weight = light.delta ? 1.0f : mis_weight(light.pdf, f.pdf);
  add_light(path.shadow_radiance, path.throughput * f.value * radiance * static_cast<float>(weight / light.pdf),
            path.bounce + 1, InvalidTerm::kLight, path, counters);
  if (path.shadow_radiance == Vec3(0)) return {};

  result.has_shadow = true;
  result.shadow_birth = light.delta ? RayBirth::kPointShadow : RayBirth::kAreaShadow;
  result.shadow_origin = offset_point(surface.position, side);
  if (light.at_infinity) {
    result.shadow_direction = light.direction;
    result.shadow_t_max = kRayInfinity;
    return {};
  }
  // The ray ends at t = 1, just before the emitter.
  const BoundedPoint target = shadow_end(light, result.shadow_origin, time_of(path));
  result.shadow_direction = offset_point(target, light.target_normal) - result.shadow_origin;
  result.shadow_t_max = 1;
  return {};
}

template <class AnyBsdf>
void Shader::sample_bounce(PathState& path, const Surface& surface, const AnyBsdf& bsdf, const Sides& media,
                           ShadeResult& result, ShadeCounters& counters) const {
  // After the last scattering a bounce can only find emission.
  if (path.bounce + 1 >= options_->bounces && !tables_->impl().lights_hit_by_chance) return;
  const Random4 drawn = random(path, Dimension::kBsdf);
  const BsdfSample sample = bsdf.sample(drawn.uniform(0), drawn.uniform(1), drawn.uniform(2));
  Vec3 throughput = path.throughput * sample.weight;
  if (!sample.finite || !finite(throughput)) counters.invalid.add(InvalidTerm::kBounce, path);
  if (!(sample.pdf > 0) || !finite(throughput) || throughput == Vec3(0)) return;
  if (path.bounce >= options_->roulette_start) {
    const float survival = std::clamp(max_component(throughput), kMinSurvival, 1.0f);
    if (random(path, Dimension::kRoulette).uniform(0) >= survival) return;
    throughput /= survival;
  }
  path.throughput = throughput;
  path.bsdf_pdf = sample.pdf;
  if (tables_->impl().lights->has_tree()) path.light_side = light_side(surface, bsdf);
  if (follows_cones_) path.cone = pack_cone(scattered_cone(unpack_cone(path.cone), sample.pdf));
  ++path.bounce;
  result.has_bounce = true;
  const Vec3 side = side_of<AnyBsdf>(surface.geometric_normal, sample.direction);
  if constexpr (AnyBsdf::kTransmits) {
    const uint32_t medium = side == surface.geometric_normal ? media.above : media.below;
    const bool one = bsdf.of_one_wavelength(sample.direction);
    path.medium = medium | (path.medium & kPathOneWavelength) | (one ? kPathOneWavelength : 0u);
  }
  result.bounce_origin = offset_point(surface.position, side);
  result.bounce_direction = sample.direction;
  result.bounce_birth = sample.birth;
}

const MaterialLayers& Shader::layers_of(const Material& material) const {
  static constexpr MaterialLayers kNone;  // of a material that an effect is forced on for
  return (material.effects & kLayerEffects) != 0 ? tables_->impl().materials.layers()[material.layers] : kNone;
}

Status Shader::add_unlit(PathState& path, const Surface& surface, const Material& material, TextureContext& textures,
                         ShadeCounters& counters) {
  SHOAL_ASSIGN_OR_RETURN(const Vec3 color, sample_base_color(material, surface, textures));
  add_light(path.radiance, path.throughput * color, path.bounce, InvalidTerm::kEmission, path, counters);
  return {};
}

Vec3 Shader::transmittance(uint32_t medium, float distance) const {
  const float* absorption = layers_of(materials_[medium - 1]).absorption;
  const auto passes = [&](int c) { return absorption[c] == 0 ? 1.0f : exp2_of(absorption[c] * distance); };
  return {passes(0), passes(1), passes(2)};
}

void Shader::absorb(PathState& path, const Surface& surface, uint32_t material, uint32_t effects) const {
  uint32_t medium = path.medium & kPathMediumMask;
  // A camera inside a volume sees its boundary from behind.
  if (path.bounce == 0 && (effects & kEffectVolume) != 0 && !surface.front &&
      layers_of(materials_[material]).volume != 0) {
    path.medium = medium = material + 1;
  }
  if (medium != 0) path.throughput *= transmittance(medium, distance_of(surface.position.point, path.origin));
}

void Shader::disperse(const PathState& path, const MaterialLayers& layers, LayeredSample& values) const {
  if (!(layers.dispersion > 0) || !values.volume || !(values.transmission > 0)) return;
  // A path has one wavelength, whatever it meets.
  const float u = sampler_.draw(path.pixel, path.sample, 0, Dimension::kWavelength).uniform(0);
  const float nanometres = kShortestWave + (kLongestWave - kShortestWave) * u;
  values.ior = dispersed_ior(layers.ior, layers.dispersion, nanometres);
  values.disperses = true;
  if ((path.medium & kPathOneWavelength) == 0) values.wavelength_weight = wavelength_weight(nanometres);
}

Status Shader::shade_layers(PathState& path, const Surface& surface, const Material& material, uint32_t effects,
                            ShadeResult& result, TextureContext& textures, ShadeCounters& counters) {
  const uint32_t mapped = ~options_->effects.off & kEffectNormalMap;
  LayeredSample values;
  SHOAL_ASSIGN_OR_RETURN(static_cast<MaterialSample&>(values), sample_material(material, surface, textures));
  SHOAL_ASSIGN_OR_RETURN(const Vec3 normal, sample_normal(material, surface, textures, mapped != 0));
  const MaterialLayers& layers = layers_of(material);
  SHOAL_RETURN_IF_ERROR(
      sample_layers(layers, material, (effects & kLayerEffects) | mapped, surface, textures, values));
  if ((effects & kEffectDispersion) != 0) disperse(path, layers, values);

  const LayeredBsdf bsdf(values, tables_->impl().lobe_tables(), surface.geometric_normal, normal, surface.wo);
  if (bsdf.black()) {
    count_invalid_surface(values, normal, path, counters);
    return {};
  }
  const uint32_t medium = path.medium & kPathMediumMask, inside = surface.attributes.material + 1;
  Sides media{medium, medium};
  if (values.volume && (values.transmission > 0 || values.diffuse_transmission > 0)) {
    media = values.outside ? Sides{medium, inside} : Sides{inside, 0};
  }
  SHOAL_RETURN_IF_ERROR(sample_light(path, surface, bsdf, media, result, textures, counters));
  sample_bounce(path, surface, bsdf, media, result, counters);
  return {};
}

void Shader::shade_miss(PathState& path, ShadeCounters& counters) {
  const ShadingTables::Impl& tables = tables_->impl();
  if (tables.environment.black()) return;
  const Vec3 direction = glm::normalize(path.direction);
  float weight = 1;
  if (path.bsdf_pdf > 0) weight = mis_weight(path.bsdf_pdf, tables.lights->environment_pdf(direction));
  add_light(path.radiance, path.throughput * tables.environment.radiance(direction) * weight, path.bounce,
            InvalidTerm::kEnvironment, path, counters);
}

}  // namespace shoal
