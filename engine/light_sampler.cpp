#include "engine/light_sampler.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "engine/frame.h"
#include "engine/math.h"
#include "engine/tree_lights.h"
#include "treelets/moving_instance.h"

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

double power_of(const Emitter&, double strength) { return 2 * kPi * strength; }
double power_of(const PunctualLight& light, double) { return punctual_power(light, 1); }

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

LightSampler::LightSampler(const Scene& scene, const LightSources& sources, const Environment& environment,
                           unsigned threads, LightChoice choice)
    : scene_(&scene), sources_(sources), environment_(&environment), uniform_(choice == LightChoice::kUniform) {
  if (choice == LightChoice::kTree) plant_tree(threads);
  if (!has_tree()) weigh_emitters();
  weigh_choices();
}

/// The corners of one that moves are those of its object.
Emitter LightSampler::emitter_at(const Emitter& emitter, float time) const {
  Emitter placed = emitter;
  if (!moves(emitter.instance)) return placed;
  const Instance now = instance_at(scene_->top_tree.instance(emitter.instance), time);
  for (int k = 0; k < 3; ++k) {
    const Vec3 p = now.object_to_world.point(corner(emitter, k));
    placed.position[3 * k] = p.x, placed.position[3 * k + 1] = p.y, placed.position[3 * k + 2] = p.z;
  }
  return placed;
}

/// `emitter`: as it stands in the middle of the shutter.
double LightSampler::weight_of(const Emitter& emitter) const {
  const double weight = emitter_area(emitter) * sampled_weight(sources_.materials[emitter.material]);
  return weight > 0 && std::isfinite(weight) ? weight : 0.0;
}

template <class Use>
void LightSampler::each_placed(const Use& use) const {
  for (uint32_t i = 0; i < sources_.emitters.size(); ++i) {
    const Emitter emitter = emitter_at(sources_.emitters[i], 0.5f);
    if (const double weight = weight_of(emitter); weight > 0) use(emitter, weight, i);
  }
  for (uint32_t i = 0; i < sources_.lights.size(); ++i) {
    const PunctualLight& light = sources_.lights[i];
    const double intensity = luminance(vector3(light.intensity));
    if (light.type == PunctualType::kDirectional || !(power_of(light, intensity) > 0) || !std::isfinite(intensity)) {
      continue;
    }
    use(light, intensity, static_cast<uint32_t>(sources_.emitters.size()) + i);
  }
}

void LightSampler::weigh_choices() {
  const std::span<const PunctualLight> lights = sources_.lights;
  for (uint32_t i = 0; i < lights.size(); ++i) {
    if (!has_tree() || lights[i].type == PunctualType::kDirectional) singles_.push_back(i);
  }

  const double radius = scene_radius(*scene_);
  std::vector<double> powers;
  for (const uint32_t i : singles_) powers.push_back(punctual_power(lights[i], radius));
  powers.push_back(placed_power());
  powers.push_back(environment_->sampled() ? 4.0 * kPi * kPi * radius * radius * environment_->mean_luminance() : 0.0);

  double sum = 0, count = 0;
  for (const double p : powers) {
    if (p > 0 && std::isfinite(p)) sum += p, ++count;
  }
  for (size_t i = 0; i < powers.size(); ++i) {
    const bool gives = powers[i] > 0 && std::isfinite(powers[i]);
    const double alike = i == singles_.size() ? emitters_.total() : 1.0;  // how many lights this is, if uniform_
    powers[i] = !gives ? 0.0 : uniform_ ? alike : 0.5 * powers[i] / sum + 0.5 / count;
  }
  choices_ = Distribution1D(powers);
  if (emitters_.total() > 0) emitter_density_ = choices_.probability(singles_.size()) / emitters_.total();
}

void LightSampler::weigh_emitters() {
  std::vector<double> weights;
  weights.reserve(sources_.emitters.size());
  for (const Emitter& e : sources_.emitters) {
    const double weight = weight_of(emitter_at(e, 0.5f));
    weights.push_back(uniform_ && weight > 0 ? 1.0 : weight);
  }
  emitters_ = Distribution1D(weights);
}

double LightSampler::placed_power() const {
  if (!has_tree()) return 2 * kPi * emitters_.total();
  double power = 0;
  each_placed([&](const auto& light, double strength, uint32_t) { power += power_of(light, strength); });
  return power;
}

void LightSampler::plant_tree(unsigned threads) {
  // Strengths go to the tree as parts of the largest, so that floats hold them and their sum.
  double largest = 0;
  uint64_t count = 0;
  each_placed([&](const auto&, double strength, uint32_t) { largest = std::max(largest, strength), ++count; });
  if (count <= kFewLights) return;
  std::vector<TreeLight> lights;
  lights.reserve(count);
  each_placed([&](const auto& light, double strength, uint32_t index) {
    lights.push_back(tree_light(light, strength / largest, index));
  });
  const size_t indices = sources_.emitters.size() + sources_.lights.size();
  tree_ = build_light_tree(std::move(lights), static_cast<uint32_t>(indices), threads);
}

LightSampler::Bytes LightSampler::bytes_at_most(uint64_t emitters, uint64_t punctual) {
  const uint64_t lights = emitters + punctual;
  Bytes bytes;
  bytes.resident = emitters * sizeof(double) + punctual * (sizeof(double) + sizeof(uint32_t)) + 4 * sizeof(double);
  bytes.making = lights * sizeof(double);
  if (lights <= kFewLights) return bytes;
  bytes.resident = std::max(bytes.resident, light_tree_bytes(lights, lights, punctual > 0) +
                                                punctual * (sizeof(double) + sizeof(uint32_t)));
  bytes.making = light_building_bytes(lights);
  return bytes;
}

uint64_t LightSampler::resident_bytes() const {
  return choices_.resident_bytes() + emitters_.resident_bytes() + tree_.resident_bytes() +
         singles_.size() * sizeof(uint32_t);
}

LightSample LightSampler::sample(const Vec3& position, const LightReceiver& receiver,
                                 const LightRandom& random, float time) const {
  double inside = 0;
  const size_t choice = choices_.sample(random.choice, &inside);
  const double chance = choices_.probability(choice);
  if (choice < singles_.size()) return sample_punctual(sources_.lights[singles_[choice]], position, chance);
  if (choice > singles_.size()) return sample_environment(chance, random);
  if (!has_tree()) {
    const size_t index = emitters_.sample(inside, nullptr);
    return sample_emitter(index, position, chance * emitters_.probability(index), random, time);
  }
  const LightTree::Choice placed = tree_.sample(receiver, inside);
  if (!(placed.chance > 0)) return {};
  const size_t emitters = sources_.emitters.size();
  if (placed.light < emitters) return sample_emitter(placed.light, position, chance * placed.chance, random, time);
  return sample_punctual(sources_.lights[placed.light - emitters], position, chance * placed.chance);
}

const Emitter* LightSampler::find_emitter(const Hit& hit) const {
  const std::span<const Emitter> emitters = sources_.emitters;
  const auto found = std::lower_bound(emitters.begin(), emitters.end(), hit, [](const Emitter& e, const Hit& h) {
    return e.instance != h.instance ? e.instance < h.instance : e.primitive < h.primitive;
  });
  const bool there = found != emitters.end() && found->instance == hit.instance && found->primitive == hit.primitive;
  return there ? &*found : nullptr;
}

double LightSampler::area_at(const Emitter& emitter, float time) const {
  return moves(emitter.instance) ? emitter_area(emitter_at(emitter, time)) : emitter_area(emitter);
}

/// Its area in the middle of the shutter over that at `time`.
double LightSampler::shrinking(const Hit& hit, float time) const {
  const Emitter* const emitter = find_emitter(hit);
  if (emitter == nullptr) return 0;
  const double area = area_at(*emitter, time);
  return area > 0 ? area_at(*emitter, 0.5f) / area : 0.0;
}

double LightSampler::found_emitter_pdf(const Hit& hit, const LightReceiver& receiver, float time) const {
  const Emitter* const emitter = find_emitter(hit);
  if (emitter == nullptr) return 0;
  const auto index = static_cast<uint32_t>(emitter - sources_.emitters.data());
  const double chance = has_tree() ? tree_.chance(receiver, index) : emitters_.probability(index);
  const double area = chance > 0 ? area_at(*emitter, time) : 0.0;
  return area > 0 ? choices_.probability(singles_.size()) * chance / area : 0.0;
}

LightSample LightSampler::sample_emitter(size_t index, const Vec3& position, double chance,
                                         const LightRandom& random, float time) const {
  LightSample sample;
  const Emitter& row = sources_.emitters[index];
  std::optional<Emitter> placed;
  if (moves(row.instance)) placed = emitter_at(row, time);
  const Emitter& e = placed ? *placed : row;
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
  sample.emitter = &row;
  sample.pdf = chance / (0.5 * doubled_area) * distance2 / std::abs(cosine);
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
  return choices_.probability(singles_.size() + 1) * environment_->pdf(direction);
}

}  // namespace shoal
