#include "engine/light_bounds.h"

#include <algorithm>
#include <cmath>

#include "engine/math.h"

namespace shoal {
namespace {

using DVec3 = glm::dvec3;

/// A union widens by this much more than it needs: twice the error of arc_tangent and sin_cos, by which its axis may be
/// off.
constexpr double kAnglePad = 2e-6;
/// Two axes whose cosine lies this close to a cone's are in it: an angle below 2e-7, less than an axis's rounding.
constexpr double kCosineSlack = 1e-14;
constexpr double kPiDouble = 3.14159265358979323846;

double angle_between(const DVec3& a, const DVec3& b) {
  const DVec3 c = glm::cross(a, b);
  return arc_tangent(static_cast<float>(std::sqrt(glm::dot(c, c))), static_cast<float>(glm::dot(a, b)));
}

SinCos sin_cos_of(double angle) { return sin_cos(static_cast<float>(angle)); }

}  // namespace

NormalCone cone_union(const NormalCone& a, const NormalCone& b) {
  NormalCone result = a;
  result.both_sides = a.both_sides || b.both_sides;
  double cosine = glm::dot(a.axis, b.axis);
  DVec3 axis_b = b.axis;
  if (cosine < 0 && (a.both_sides || b.both_sides)) {
    // Whichever has both sides may be turned round: turn the axis of `b`, or that of the result.
    cosine = -cosine;
    if (b.both_sides) {
      axis_b = -axis_b;
    } else {
      result.axis = -result.axis;
    }
  }
  if (a.angle >= NormalCone::kEveryWay || b.angle >= NormalCone::kEveryWay) {
    result.angle = NormalCone::kEveryWay, result.cos_angle = -1;
    return result;
  }
  if (b.angle == 0 && cosine >= a.cos_angle - kCosineSlack) return result;

  const double between = angle_between(result.axis, axis_b);
  if (between + b.angle <= a.angle) return result;
  const bool both_sides = result.both_sides;
  if (between + a.angle <= b.angle) {
    result = b;
    result.axis = axis_b, result.both_sides = both_sides;
    return result;
  }
  const double angle = 0.5 * (a.angle + between + b.angle) + kAnglePad;
  const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
  if (angle >= kPiDouble) {
    result.angle = NormalCone::kEveryWay;
  } else if (!(sine > 1e-6)) {
    // Nearly the same axes need none in between, opposite ones have none.
    result.angle = cosine > 0 ? std::max(a.angle, b.angle) + between + kAnglePad : NormalCone::kEveryWay;
  } else {
    // Turn the axis of `a` towards that of `b`, so far that both cones fit.
    const SinCos turn = sin_cos_of(angle - kAnglePad - a.angle);
    const DVec3 across = (axis_b - result.axis * cosine) / sine;
    const DVec3 axis = result.axis * double{turn.cos} + across * double{turn.sin};
    result.axis = axis / std::sqrt(glm::dot(axis, axis));
    result.angle = angle;
  }
  result.cos_angle = result.angle >= NormalCone::kEveryWay ? -1.0 : sin_cos_of(result.angle).cos;
  return result;
}

void LightBounds::add(const LightBounds& other) {
  if (!(other.strength > 0)) return;
  if (!(strength > 0)) {
    *this = other;
    return;
  }
  box.include(other.box);
  cone = cone_union(cone, other.cone);
  emission_angle = std::max(emission_angle, other.emission_angle);
  strength += other.strength;
  range = std::max(range, other.range);
}

double emission_solid_angle(double cosine, double wider, double emission_angle) {
  const double o = std::min(arc_cosine(static_cast<float>(cosine)) + wider, kPiDouble);
  const double w = std::min(o + emission_angle, kPiDouble);
  const SinCos at_o = sin_cos_of(o);
  return 2 * kPiDouble * (1 - double{at_o.cos}) +
         0.5 * kPiDouble * (2 * (w - o) * at_o.sin - sin_cos_of(o - 2 * w).cos + at_o.cos);
}

}  // namespace shoal
