// An orthonormal frame around a normal, and the cosine-weighted hemisphere. Branchless construction of Duff et al.
// 2017, "Building an Orthonormal Basis, Revisited", JCGT 6(1), listing 3. Called by shading. Pure functions.
#pragma once

#include <cmath>

#include "engine/math.h"
#include "treelets/vector.h"

namespace shoal {

struct Frame {
  Vec3 x, y, z;

  /// Requires: unit length.
  explicit Frame(const Vec3& normal) : z(normal) {
    const float sign = std::copysign(1.0f, z.z);
    const float a = -1 / (sign + z.z), b = z.x * z.y * a;
    x = {1 + sign * z.x * z.x * a, sign * b, -sign * z.x};
    y = {b, sign + z.y * z.y * a, -z.y};
  }
  Vec3 to_world(const Vec3& v) const { return x * v.x + y * v.y + z * v.z; }
  Vec3 to_local(const Vec3& v) const { return {glm::dot(x, v), glm::dot(y, v), glm::dot(z, v)}; }
};

/// Density cos(theta) / pi; z > 0.
inline Vec3 sample_cosine_hemisphere(float u1, float u2) {
  const float radius = std::sqrt(u1);
  const SinCos phi = sin_cos(2 * kPi * u2);
  return {radius * phi.cos, radius * phi.sin, std::sqrt(1 - u1)};  // u1 < 1
}

/// Relative luminance of linear sRGB (ITU-R BT.709).
inline float luminance(const Vec3& c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }
inline float max_component(const Vec3& c) { return std::max(c.x, std::max(c.y, c.z)); }

}  // namespace shoal
