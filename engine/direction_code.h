// A unit vector in 30 bits: octahedral, 15 bits a coordinate (Cigolle et al. 2014, "A Survey of Efficient
// Representations for Independent Unit Vectors", JCGT 3(2)). Code 0 stands for no direction. Called by
// engine/light_tree and engine/shade. Pure; about 5 ns.
#pragma once

#include <cmath>
#include <cstdint>

#include "treelets/vector.h"

namespace shoal {

/// Bounds the angle between a direction and its code's, in radians. A coordinate is off by half a step, h = 1 / 32767,
/// so the point on the octahedron |x| + |y| + |z| = 1 moves by at most sqrt(1 + 1 + 4) h, seen from at least
/// 1 / sqrt(3) away: sqrt(18) h = 1.295e-4, and rounding to float.
inline constexpr double kDirectionCodeError = 1.35e-4;

inline uint32_t encode_direction(const Vec3& direction) {
  const float sum = std::abs(direction.x) + std::abs(direction.y) + std::abs(direction.z);
  if (!(sum > 0) || !std::isfinite(sum)) return 0;
  float u = direction.x / sum, v = direction.y / sum;
  if (direction.z < 0) {
    const float folded = std::copysign(1 - std::abs(v), u);
    v = std::copysign(1 - std::abs(u), v), u = folded;
  }
  const auto code = [](float x) { return static_cast<uint32_t>((x * 0.5f + 0.5f) * 32767.0f + 0.5f); };
  const uint32_t both = code(u) | code(v) << 15;
  return both == 0 ? 0x3fffffffu : both;  // two corners of the same direction, -z
}

/// Unit. Requires: not 0.
inline glm::dvec3 decode_direction(uint32_t code) {
  const double u = (code & 0x7fffu) * (2.0 / 32767) - 1, v = (code >> 15) * (2.0 / 32767) - 1;
  const double z = 1 - std::abs(u) - std::abs(v);
  const double fold = z < 0 ? -z : 0.0;
  const glm::dvec3 p(u - std::copysign(fold, u), v - std::copysign(fold, v), z);
  return p / std::sqrt(glm::dot(p, p));
}

}  // namespace shoal
