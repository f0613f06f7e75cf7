// Vectors, boxes and affine maps: GLM's types under our names. SIMD is off in GLM, so every operation is one
// IEEE operation in the order written, on every instruction set.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

namespace shoal {

using Vec2 = glm::vec2;
using Vec3 = glm::vec3;
using Vec4 = glm::vec4;

/// An axis-aligned box; empty when lo > hi.
struct Bounds3 {
  Vec3 lo{std::numeric_limits<float>::infinity()};
  Vec3 hi{-std::numeric_limits<float>::infinity()};

  void include(const Vec3& p) { lo = glm::min(lo, p), hi = glm::max(hi, p); }
  void include(const Bounds3& b) { lo = glm::min(lo, b.lo), hi = glm::max(hi, b.hi); }
  bool empty() const { return !(lo.x <= hi.x && lo.y <= hi.y && lo.z <= hi.z); }
  Vec3 extent() const { return hi - lo; }
  /// Half the surface area (the SAH needs ratios only).
  float half_area() const {
    const Vec3 e = hi - lo;
    return empty() ? 0.0f : e.x * e.y + e.y * e.z + e.z * e.x;
  }
};

/// x -> linear * x + translation. Columns as in glTF matrices.
struct Affine3 {
  Vec3 column_x{1, 0, 0}, column_y{0, 1, 0}, column_z{0, 0, 1}, translation{0, 0, 0};

  Vec3 point(const Vec3& p) const { return column_x * p.x + column_y * p.y + column_z * p.z + translation; }
  Vec3 vector(const Vec3& v) const { return column_x * v.x + column_y * v.y + column_z * v.z; }
  /// The transpose of the linear part times n: maps a normal when *this is the inverse of the point map.
  Vec3 transposed_vector(const Vec3& n) const {
    return {glm::dot(column_x, n), glm::dot(column_y, n), glm::dot(column_z, n)};
  }
  bool operator==(const Affine3&) const = default;
};
static_assert(sizeof(Affine3) == 48);

}  // namespace shoal
