#include "engine/tree_lights.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/math.h"

namespace shoal {
namespace {

using DVec3 = glm::dvec3;

/// Twice the error of arc_cosine.
constexpr float kAnglePad = 2e-6f;
/// How far the squared length of a direction may be from one.
constexpr double kUnitSlack = 1e-5;

float strength_in_float(double strength) {
  return static_cast<float>(std::clamp(strength, double{std::numeric_limits<float>::min()}, 1.0));
}

}  // namespace

TreeLight tree_light(const Emitter& emitter, double strength, uint32_t index) {
  TreeLight light = {};
  const auto corner = [&](int k, int c) { return emitter.position[3 * k + c]; };
  DVec3 edge1, edge2;
  for (int c = 0; c < 3; ++c) {
    light.lo[c] = std::min({corner(0, c), corner(1, c), corner(2, c)});
    light.hi[c] = std::max({corner(0, c), corner(1, c), corner(2, c)});
    edge1[c] = double{corner(1, c)} - corner(0, c);
    edge2[c] = double{corner(2, c)} - corner(0, c);
  }
  const DVec3 normal = glm::cross(edge1, edge2);
  const double length = glm::length(normal);
  for (int c = 0; c < 3; ++c) light.axis[c] = static_cast<float>(normal[c] / length);
  light.emission_angle = 0.5f * kPi;
  light.strength = strength_in_float(strength);
  light.range = std::numeric_limits<float>::infinity();
  light.light = index;
  light.both_sides = 1;
  return light;
}

TreeLight tree_light(const PunctualLight& light, double strength, uint32_t index) {
  TreeLight out = {};
  std::copy_n(light.position, 3, out.lo);
  std::copy_n(light.position, 3, out.hi);
  out.strength = strength_in_float(strength);
  out.range = light.range > 0 ? light.range : std::numeric_limits<float>::infinity();
  out.light = index;
  out.axis[2] = 1, out.angle = NormalCone::kEveryWay;
  const DVec3 direction(light.direction[0], light.direction[1], light.direction[2]);
  const bool unit = std::abs(glm::dot(direction, direction) - 1) < kUnitSlack;
  if (light.type != PunctualType::kSpot || !unit) return out;
  const float outer = arc_cosine(light.cos_outer) + kAnglePad;
  std::copy_n(light.direction, 3, out.axis);
  out.angle = std::min(arc_cosine(light.cos_inner), outer);
  out.emission_angle = outer - out.angle;
  return out;
}

}  // namespace shoal
