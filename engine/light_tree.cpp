#include "engine/light_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "engine/math.h"
#include "treelets/ray.h"

namespace shoal {
namespace {

using DVec3 = glm::dvec3;

constexpr uint32_t kCosineMask = 0x7fff, kBothSides = 1u << 30;
constexpr int kEmissionShift = 15;
/// At the edge of what a light may reach, as a sine: what the codes of directions may be off by. A light there counts
/// by this much instead of nothing.
constexpr double kEdge = kDirectionCodeError;
constexpr double kBelowOne = 0x1.fffffffffffffp-1;

/// Rounded down: the angle is rounded up.
uint32_t cosine_code(double cosine) {
  return static_cast<uint32_t>(std::clamp(std::floor((cosine + 1) * (0.5 * kCosineMask)), 0.0, double{kCosineMask}));
}
double cosine_of(uint32_t code) { return (code & kCosineMask) * (2.0 / kCosineMask) - 1; }

/// At most the cosine of an angle that is wider by `more`, below 1e-3: cos(a + e) >= cos a - e sin a - e^2 / 2.
/// `cosine` may be off by 2e-7, and its sine then by 7e-4.
double cosine_of_wider(double cosine, double more) {
  const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
  return cosine - more * (sine + 7e-4 + more) - 2e-7;
}

/// Of a light's emission angle, rounded down by the error of sin_cos.
double emission_cosine(double angle) {
  if (angle == double{0.5f * kPi}) return -2e-7;  // of all triangles
  if (angle >= 3.14159) return -1;
  return sin_cos(static_cast<float>(angle)).cos - 2e-7;
}

struct Angle {
  double cos, sin;
};

Angle from_cosine(double cosine) {
  const double c = std::clamp(cosine, -1.0, 1.0);
  return {c, std::sqrt(1 - c * c)};
}

/// max(0, a - b), for angles in [0, pi].
Angle subtract(const Angle& a, const Angle& b) {
  if (a.cos >= b.cos) return {1, 0};
  return {a.cos * b.cos + a.sin * b.sin, a.sin * b.cos - a.cos * b.sin};
}

}  // namespace

LightNode pack_light_node(const LightBounds& bounds, uint32_t child) {
  LightNode node;
  double squared = 0;
  for (int c = 0; c < 3; ++c) {
    const double lo = bounds.box.lo[c], hi = bounds.box.hi[c];
    node.center[c] = static_cast<float>(0.5 * (lo + hi));
    const double reach = std::max(hi - node.center[c], node.center[c] - lo);
    squared += reach * reach;
  }
  if (squared > 0) {
    constexpr double kLargest = std::numeric_limits<float>::max() / 2;  // half, so that the next number is finite too
    const float radius = static_cast<float>(std::min(std::sqrt(squared), kLargest));
    node.radius = std::bit_cast<float>(std::bit_cast<uint32_t>(radius) + 1);  // the next number
  }
  node.strength = static_cast<float>(bounds.strength);
  node.axis = encode_direction(Vec3(bounds.cone.axis));
  node.cosines = cosine_code(cosine_of_wider(bounds.cone.cos_angle, kDirectionCodeError)) |
                 cosine_code(emission_cosine(bounds.emission_angle)) << kEmissionShift |
                 (bounds.cone.both_sides ? kBothSides : 0);
  node.child = child;
  return node;
}

LightImportance::LightImportance(const LightReceiver& receiver)
    : position_(receiver.position), has_side_(receiver.side != 0) {
  if (has_side_) normal_ = decode_direction(receiver.side);
}

double LightImportance::operator()(const LightNode& node, float range) const {
  const DVec3 from_center = position_ - DVec3(node.center[0], node.center[1], node.center[2]);
  const double distance2 = glm::dot(from_center, from_center), radius2 = double{node.radius} * node.radius;
  // Among the lights; where they are one point there is nothing to see of them.
  if (distance2 <= radius2) return radius2 > 0 ? node.strength / radius2 : 0.0;

  const double scale = 1 / std::sqrt(distance2);
  const double sphere_sine2 = radius2 / distance2;
  const Angle sphere{std::sqrt(1 - sphere_sine2), std::sqrt(sphere_sine2)};
  double along = glm::dot(decode_direction(node.axis), from_center) * scale;
  if ((node.cosines & kBothSides) != 0) along = std::abs(along);
  // The least angle between an axis of a light and its way to the place.
  const Angle axes = subtract(from_cosine(along), from_cosine(cosine_of(node.cosines)));
  const double emitted = subtract(axes, sphere).cos;
  if (emitted <= cosine_of(node.cosines >> kEmissionShift)) return 0;
  double importance = node.strength * std::max(emitted, kEdge) / distance2;
  if (range < std::numeric_limits<float>::infinity()) {
    // The nearest that a light may be: 1 - (distance / range)^4 (KHR_lights_punctual).
    const double ratio = (distance2 * scale - node.radius) / range, ratio2 = ratio * ratio;
    if (ratio > 1 + kEdge) return 0;
    if (ratio > 0) importance *= std::max(1 - ratio2 * ratio2, kEdge);
  }
  if (has_side_) {
    const double received = subtract(from_cosine(-glm::dot(normal_, from_center) * scale), sphere).cos + kEdge;
    if (!(received > 0)) return 0;
    importance *= received;
  }
  return importance;
}

LightTree::LightTree(uint32_t root, std::vector<LightFork> forks, std::vector<uint32_t> leaf_of,
                     std::vector<LightRanges> ranges)
    : root_(root), forks_(std::move(forks)), leaf_of_(std::move(leaf_of)), ranges_(std::move(ranges)) {}

LightTree::Choice LightTree::sample(const LightReceiver& receiver, double u) const {
  const LightImportance importance(receiver);
  Choice choice{0, 1, u};
  uint32_t at = root_;
  while ((at & LightNode::kLeafBit) == 0) {
    const LightFork& fork = forks_[at];
    const auto [left, right] = weigh(importance, at).side;
    const double sum = left + right;
    if (!(sum > 0)) return {};
    const double split = left / sum;
    if (choice.remainder < split) {
      choice.chance *= split;
      choice.remainder = std::min(choice.remainder / split, kBelowOne);
      at = fork.side[0].child;
    } else {
      choice.chance *= right / sum;
      choice.remainder = std::min((choice.remainder - split) / (1 - split), kBelowOne);
      at = fork.side[1].child;
    }
  }
  choice.light = at & ~LightNode::kLeafBit;
  return choice;
}

double LightTree::chance(const LightReceiver& receiver, uint32_t light) const {
  const uint32_t leaf = leaf_of_[light];
  if (leaf == kNoIndex) return 0;
  const LightImportance importance(receiver);
  double chance = 1;
  uint32_t at = root_;
  while ((at & LightNode::kLeafBit) == 0) {
    const int side = leaf <= at ? 0 : 1;
    const auto [left, right] = weigh(importance, at).side;
    const double sum = left + right;
    if (!(sum > 0)) return 0;
    chance *= (side == 0 ? left : right) / sum;
    at = forks_[at].side[side].child;
  }
  return chance;
}

}  // namespace shoal
