// The ray-triangle test: watertight (Woop, Benthin & Wald 2013, "Watertight Ray/Triangle Intersection"), both
// sides. The corners are translated and sheared in float, alike for every triangle that shares them; then the signs
// of the three edge functions are decided exactly: in float where the rounding error cannot change the sign, else
// in double, where products of floats are exact. Scalar; the SIMD kernel only rejects what this certainly rejects.
//
// Error of an edge function e = p1 - p2 of two rounded products (u = 2^-24; the subtraction keeps the sign):
// |(p1 - p2) - exact| <= u (|p1| + |p2|) + 2^-149, and the sum below is itself rounded; 2u and FLT_MIN cover both.
#pragma once

#include "treelets/box_test.h"
#include "treelets/ray_space.h"

namespace shoal {

inline constexpr float kEdgeError = 2 * kRoundingUnit;
inline constexpr float kEdgeUnderflow = std::numeric_limits<float>::min();

struct TriangleHit {
  float t, b1, b2;  ///< barycentrics of the second and third corner
};

namespace triangle_test {

struct Sheared {
  float x, y, z;
};

inline Sheared shear(const RaySpace& ray, const Vec3& p) {
  const float z = p[ray.kz] - ray.origin[ray.kz];
  return {(p[ray.kx] - ray.origin[ray.kx]) - ray.shear_x * z, (p[ray.ky] - ray.origin[ray.ky]) - ray.shear_y * z,
          z};
}

template <class T>
bool of_both_signs(T u, T v, T w) {
  return (u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0);
}

/// The edge function of the edge a-b in float; sets `certain` to whether its sign is.
inline float edge(const Sheared& a, const Sheared& b, bool& certain) {
  const float p1 = a.x * b.y, p2 = a.y * b.x;
  const float e = p1 - p2;
  certain = std::abs(e) > kEdgeError * (std::abs(p1) + std::abs(p2)) + kEdgeUnderflow;
  return e;
}

inline double exact_edge(const Sheared& a, const Sheared& b) {
  return static_cast<double>(a.x) * b.y - static_cast<double>(a.y) * b.x;
}

/// The line of the ray meets the triangle: sets t (any sign, unclamped, perhaps NaN) and the weights. Those come
/// from the exact edge functions: in float their error, divided by the area that the ray sees, moves t of a sliver
/// or of a grazing ray by far more than the error of the corners, and a ray would meet the triangle that it leaves.
inline bool cross_line(const RaySpace& ray, const Vec3& p0, const Vec3& p1, const Vec3& p2, TriangleHit& hit) {
  const Sheared a = shear(ray, p0), b = shear(ray, p1), c = shear(ray, p2);
  bool certain[3];
  const float u = edge(c, b, certain[0]), v = edge(a, c, certain[1]), w = edge(b, a, certain[2]);
  if (of_both_signs(certain[0] ? u : 0, certain[1] ? v : 0, certain[2] ? w : 0)) return false;
  const double eu = exact_edge(c, b), ev = exact_edge(a, c), ew = exact_edge(b, a);
  const double det = eu + ev + ew;
  if (of_both_signs(eu, ev, ew) || det == 0) return false;
  const double inverse = 1 / det;
  const double b0 = eu * inverse, b1 = ev * inverse, b2 = ew * inverse;
  hit.t = static_cast<float>((b0 * a.z + b1 * b.z + b2 * c.z) / ray.direction[ray.kz]);
  hit.b1 = static_cast<float>(b1);
  hit.b2 = static_cast<float>(b2);
  return true;
}

}  // namespace triangle_test

/// The ray meets the triangle at 0 < t <= t_max. t is clamped to the span of the triangle's own box (box_test.h).
inline bool intersect_triangle(const RaySpace& ray, const Vec3& p0, const Vec3& p1, const Vec3& p2, float t_max,
                               TriangleHit& hit) {
  if (!triangle_test::cross_line(ray, p0, p1, p2, hit)) return false;
  const Vec3 lo = glm::min(glm::min(p0, p1), p2), hi = glm::max(glm::max(p0, p1), p2);
  const BoxSpan span = cross_box(ray, &lo.x, &hi.x);
  if (!span.entered(t_max)) return false;
  hit.t = std::min(std::max(hit.t, span.t_near), span.t_far);
  return hit.t > 0 && hit.t <= t_max;
}

}  // namespace shoal
