#include "engine/light_sampler.h"

#include <cmath>

#include "engine/frame.h"
#include "engine/math.h"

namespace shoal {
namespace {

using DVec3 = glm::dvec3;

Vec3 corner(const Emitter& e, int i) { return {e.position[3 * i], e.position[3 * i + 1], e.position[3 * i + 2]}; }
Vec3 vector3(const float (&v)[3]) { return {v[0], v[1], v[2]}; }

DVec3 doubled_area_vector(const Emitter& e) {
  const DVec3 p0 = corner(e, 0);
  return glm::cross(DVec3(corner(e, 1)) - p0, DVec3(corner(e, 2)) - p0);
}

double scene_radius(const Scene& scene) {
  const Bounds3 bounds = scene.top_tree.bounds();
  const double radius = bounds.empty() ? 0.0 : 0.5 * glm::length(DVec3(bounds.hi) - DVec3(bounds.lo));
  return radius > 0 && std::isfinite(radius) ? radius : 1.0;
}

double punctual_power(const PunctualLight& light, double radius) {
  const double intensity = luminance(vector3(light.intensity));
  switch (light.type) {
    case PunctualType::kDirectional:
      return kPi * radius * radius * intensity;
    case PunctualType::kPoint:
      return 4 * kPi * intensity;
    case PunctualType::kSpot:
      return 2 * kPi * (1 - static_cast<double>(light.cos_outer)) * intensity;
  }
  return 0;
}

/// Angular attenuation of KHR_lights_punctual: (cos - cos_outer) / (cos_inner - cos_outer), clamped, squared.
float spot_attenuation(const PunctualLight& light, float cosine) {
  const float scale = 1 / std::max(0.001f, light.cos_inner - light.cos_outer);
  const float x = std::clamp((cosine - light.cos_outer) * scale, 0.0f, 1.0f);
  return x * x;
}

/// What KHR_lights_punctual recommends for lights with a range: clamp(1 - (distance / range)^4).
double range_attenuation(const PunctualLight& light, double distance2) {
  if (!(light.range > 0)) return 1;
  const double ratio2 = distance2 / (static_cast<double>(light.range) * light.range);
  return std::max(0.0, 1 - ratio2 * ratio2);
}

}  // namespace

double emitter_area(const Emitter& emitter) { return 0.5 * glm::length(doubled_area_vector(emitter)); }

LightSampler::LightSampler(const Scene& scene, const Environment& environment)
    : scene_(&scene), environment_(&environment) {
  weigh_emitters();
  const double radius = scene_radius(scene);
  std::vector<double> powers;
  for (const PunctualLight& light : scene.lights) powers.push_back(punctual_power(light, radius));
  powers.push_back(2 * kPi * emitters_.total());
  powers.push_back(environment.sampled() ? 4.0 * kPi * kPi * radius * radius * environment.mean_luminance() : 0.0);

  double sum = 0, count = 0;
  for (const double p : powers) {
    if (p > 0 && std::isfinite(p)) sum += p, ++count;
  }
  for (double& p : powers) p = p > 0 && std::isfinite(p) ? 0.5 * p / sum + 0.5 / count : 0.0;
  lights_ = Distribution1D(powers);
  if (emitters_.total() > 0) emitter_density_ = lights_.probability(scene.lights.size()) / emitters_.total();
}

void LightSampler::weigh_emitters() {
  std::vector<double> weights;
  weights.reserve(scene_->emitters.size());
  for (const Emitter& e : scene_->emitters) {
    weights.push_back(emitter_area(e) * sampled_weight(scene_->materials[e.material]));
  }
  emitters_ = Distribution1D(weights);
}

LightSample LightSampler::sample(const Vec3& position, const LightRandom& random) const {
  double inside = 0;
  const size_t light = lights_.sample(random.choice, &inside);
  const double chance = lights_.probability(light);
  const size_t punctual_count = scene_->lights.size();
  if (light < punctual_count) return sample_punctual(scene_->lights[light], position, chance);
  if (light == punctual_count) return sample_emitter(position, chance, inside, random);
  return sample_environment(chance, random);
}

LightSample LightSampler::sample_emitter(const Vec3& position, double chance, double choice,
                                         const LightRandom& random) const {
  LightSample sample;
  const size_t index = emitters_.sample(choice, nullptr);
  const Emitter& e = scene_->emitters[index];
  const DVec3 area_vector = doubled_area_vector(e);
  const double doubled_area = glm::length(area_vector);

  // Uniform on a triangle (Shirley, Wang & Zimmerman 1996, section 3.2).
  const float root = std::sqrt(static_cast<float>(random.u1));
  const float b1 = 1 - root, b2 = static_cast<float>(random.u2) * root;
  sample.target = point_on_triangle(corner(e, 0), corner(e, 1), corner(e, 2), b1, b2);
  if (e.instance < scene_->top_tree.instance_count()) sample.instance = &scene_->top_tree.instance(e.instance);
  const Vec2 uv0(e.uv[0], e.uv[1]), uv1(e.uv[2], e.uv[3]), uv2(e.uv[4], e.uv[5]);
  sample.emitter_uv = uv0 + (uv1 - uv0) * b1 + (uv2 - uv0) * b2;

  const DVec3 to_light = DVec3(sample.target.point) - DVec3(position);
  const double distance2 = glm::dot(to_light, to_light);
  const double cosine = glm::dot(area_vector, to_light) / (doubled_area * std::sqrt(distance2));
  if (!(distance2 > 0) || !(std::abs(cosine) > 0)) return {};
  sample.direction = Vec3(to_light / std::sqrt(distance2));
  sample.target_normal = Vec3(area_vector * ((cosine > 0 ? -1 : 1) / doubled_area));
  sample.radiance = Vec3(1);
  sample.emitter = &e;
  sample.pdf = chance * emitters_.probability(index) / (0.5 * doubled_area) * distance2 / std::abs(cosine);
  return sample;
}

LightSample LightSampler::sample_punctual(const PunctualLight& light, const Vec3& position, double chance) const {
  LightSample sample;
  sample.delta = true;
  sample.pdf = chance;
  sample.radiance = vector3(light.intensity);
  if (light.type == PunctualType::kDirectional) {
    sample.direction = -vector3(light.direction);
    sample.at_infinity = true;
    return sample;
  }
  sample.target.point = vector3(light.position);
  const DVec3 to_light = DVec3(sample.target.point) - DVec3(position);
  const double distance2 = glm::dot(to_light, to_light);
  if (!(distance2 > 0)) return {};
  sample.direction = Vec3(to_light / std::sqrt(distance2));
  sample.radiance *= static_cast<float>(range_attenuation(light, distance2) / distance2);
  if (light.type == PunctualType::kSpot) {
    sample.radiance *= spot_attenuation(light, -glm::dot(vector3(light.direction), sample.direction));
  }
  return sample;
}

LightSample LightSampler::sample_environment(double chance, const LightRandom& random) const {
  LightSample sample;
  float pdf = 0;
  sample.direction = environment_->sample(random.u1, random.u2, &pdf);
  if (!(pdf > 0)) return {};
  sample.radiance = environment_->radiance(sample.direction);
  sample.pdf = chance * pdf;
  sample.at_infinity = true;
  return sample;
}

double LightSampler::environment_pdf(const Vec3& direction) const {
  if (!environment_->sampled()) return 0;
  return lights_.probability(scene_->lights.size() + 1) * environment_->pdf(direction);
}

}  // namespace shoal
