// The ray-triangle test: watertight (Woop, Benthin & Wald 2013, "Watertight Ray/Triangle Intersection"), both
// sides. The corners are translated and sheared in float, alike for every triangle that shares them; then the signs
// of the three edge functions are decided exactly, in double, where products of floats are exact. The SIMD
// kernels test whole leaves in float first and reject only what this certainly rejects (leaf_kernel-inl.h), then do
// these operations in lanes, to the same bits (hit_kernel-inl.h, packet_leaf_kernel-inl.h).
// That is TriangleTest::kWatertight, the default. kFast and kDouble differ in cross_line() only: whatever it says, a hit
// counts only if the triangle's own box is entered, and lies in that box's span, so that boxes hold for all three.
//
// Error of an edge function e = p1 - p2 in float, p2 rounded, p1 rounded or fused (u = 2^-24):
// |e - exact| <= u |p1| + u |p2| + u |e| + 2^-149 with |p1| <= |p2| + |e| (1 + u), so that the sign is certain when
// |e| > 3 u |p2| + FLT_MIN.
#pragma once

#include "treelets/box_test.h"
#include "treelets/lane_box.h"
#include "treelets/ray_space.h"
#include "treelets/triangle_test_kind.h"

namespace shoal {

inline constexpr float kEdgeError = 3 * kRoundingUnit;
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

inline bool of_both_signs(double u, double v, double w) {
  return ((u < 0) | (v < 0) | (w < 0)) & ((u > 0) | (v > 0) | (w > 0));
}

inline double exact_edge(const Sheared& a, const Sheared& b) {
  return static_cast<double>(a.x) * b.y - static_cast<double>(a.y) * b.x;
}

/// The line of the ray meets the triangle, for each kind of test.
template <TriangleTest kTest>
bool cross_line(const RaySpace& ray, const Vec3& p0, const Vec3& p1, const Vec3& p2, TriangleHit& hit);

/// Sets t (any sign, unclamped, perhaps NaN) and the weights. Those come
/// from the exact edge functions: in float their error, divided by the area that the ray sees, moves t of a sliver
/// or of a grazing ray by far more than the error of the corners, and a ray would meet the triangle that it leaves.
template <>
inline bool cross_line<TriangleTest::kWatertight>(const RaySpace& ray, const Vec3& p0, const Vec3& p1, const Vec3& p2,
                                                  TriangleHit& hit) {
  const Sheared a = shear(ray, p0), b = shear(ray, p1), c = shear(ray, p2);
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

/// Everything in float, never fused. A sum of edges that is not a normal number is a miss, so that weights are finite.
template <>
inline bool cross_line<TriangleTest::kFast>(const RaySpace& ray, const Vec3& p0, const Vec3& p1, const Vec3& p2,
                                            TriangleHit& hit) {
  const Sheared a = shear(ray, p0), b = shear(ray, p1), c = shear(ray, p2);
  const float eu = c.x * b.y - c.y * b.x, ev = a.x * c.y - a.y * c.x, ew = b.x * a.y - b.y * a.x;
  const float det = eu + ev + ew, size = std::abs(det);
  if (((eu < 0) | (ev < 0) | (ew < 0)) & ((eu > 0) | (ev > 0) | (ew > 0))) return false;
  if (!(size >= std::numeric_limits<float>::min() && size <= std::numeric_limits<float>::max())) return false;
  const float inverse = 1 / det;
  hit.b1 = ev * inverse, hit.b2 = ew * inverse;
  hit.t = (eu * inverse * a.z + hit.b1 * b.z + hit.b2 * c.z) / ray.direction[ray.kz];
  return true;
}

struct ShearedDouble {
  double x, y, z;
};

/// The difference between a product and its rounded value, exactly (Dekker 1971).
inline double product_error(double a, double b, double rounded) {
  constexpr double kSplit = 0x1p27 + 1;
  const double as = kSplit * a, bs = kSplit * b;
  const double ah = as - (as - a), bh = bs - (bs - b), al = a - ah, bl = b - bh;
  return al * bl - (((rounded - ah * bh) - al * bh) - ah * bl);
}

/// Of the right sign: products of different rounded values differ the same way, others differ by their errors. From floats
/// neither over- nor underflows here.
inline double signed_edge(const ShearedDouble& a, const ShearedDouble& b) {
  const double p = a.x * b.y, q = a.y * b.x;
  if (p != q) return p - q;
  return product_error(a.x, b.y, p) - product_error(a.y, b.x, q);
}

template <>
inline bool cross_line<TriangleTest::kDouble>(const RaySpace& ray, const Vec3& p0, const Vec3& p1, const Vec3& p2,
                                              TriangleHit& hit) {
  const double dz = ray.direction[ray.kz];
  const double shear_x = ray.direction[ray.kx] / dz, shear_y = ray.direction[ray.ky] / dz;
  const auto sheared = [&](const Vec3& p) {
    const double z = static_cast<double>(p[ray.kz]) - ray.origin[ray.kz];
    return ShearedDouble{(static_cast<double>(p[ray.kx]) - ray.origin[ray.kx]) - shear_x * z,
                         (static_cast<double>(p[ray.ky]) - ray.origin[ray.ky]) - shear_y * z, z};
  };
  const ShearedDouble a = sheared(p0), b = sheared(p1), c = sheared(p2);
  const double eu = signed_edge(c, b), ev = signed_edge(a, c), ew = signed_edge(b, a);
  const double det = eu + ev + ew;
  if (of_both_signs(eu, ev, ew) || det == 0) return false;
  const double inverse = 1 / det;
  const double b0 = eu * inverse, b1 = ev * inverse, b2 = ew * inverse;
  hit.t = static_cast<float>((b0 * a.z + b1 * b.z + b2 * c.z) / dz);
  hit.b1 = static_cast<float>(b1);
  hit.b2 = static_cast<float>(b2);
  return true;
}

/// cross_box() for the triangle's own box, in lanes: of its corners. Requires: finite corners.
inline BoxSpan cross_own_box(const RaySpace& ray, Lanes a, Lanes b, Lanes c) {
  const Lanes origin = lanes_load3(ray.origin), inverse = lanes_load3(ray.inverse), pad = lanes_set(ray.pad);
  const Lanes most = lanes_set(std::numeric_limits<float>::max());
  const Lanes least = lanes_set(-std::numeric_limits<float>::max());
  const Lanes far_inverse = lanes_min(lanes_max(lanes_mul(inverse, lanes_set(kFarScale)), least), most);
  const Lanes lo = lanes_sub(lanes_min(lanes_min(a, b), c), lanes_add(origin, pad));
  const Lanes hi = lanes_sub(lanes_max(lanes_max(a, b), c), lanes_sub(origin, pad));
  float near[4], far[4];  // lo <= hi: so the lesser product is that of the near plane
  lanes_store(lanes_min(lanes_mul(lo, inverse), lanes_mul(hi, inverse)), near);
  lanes_store(lanes_max(lanes_mul(lo, far_inverse), lanes_mul(hi, far_inverse)), far);
  constexpr float kMax = std::numeric_limits<float>::max();
  if (ray.extreme) [[unlikely]] {
    for (int axis = 0; axis < 3; ++axis) {
      if (std::abs(ray.inverse[axis]) == kMax) far[axis] *= kMax;
    }
  }
  return {std::max(0.0f, std::max(near[2], std::max(near[1], near[0]))),
          std::min(std::min(far[2], std::min(far[1], far[0])), kMax)};
}

}  // namespace triangle_test

/// The ray meets the triangle at 0 < t <= t_max. t is clamped to the span of the triangle's own box (box_test.h).
template <TriangleTest kTest = TriangleTest::kWatertight>
inline bool intersect_triangle(const RaySpace& ray, const Vec3& p0, const Vec3& p1, const Vec3& p2, float t_max,
                               TriangleHit& hit) {
  if (!triangle_test::cross_line<kTest>(ray, p0, p1, p2, hit)) return false;
  const BoxSpan span = triangle_test::cross_own_box(ray, lanes_set(p0.x, p0.y, p0.z), lanes_set(p1.x, p1.y, p1.z),
                                                    lanes_set(p2.x, p2.y, p2.z));
  if (!span.entered(t_max)) return false;
  hit.t = std::min(std::max(hit.t, span.t_near), span.t_far);
  return hit.t > 0 && hit.t <= t_max;
}

/// The same by a kind that is known at run time.
inline bool intersect_triangle(TriangleTest test, const RaySpace& ray, const Vec3& p0, const Vec3& p1, const Vec3& p2,
                               float t_max, TriangleHit& hit) {
  if (test == TriangleTest::kFast) return intersect_triangle<TriangleTest::kFast>(ray, p0, p1, p2, t_max, hit);
  if (test == TriangleTest::kDouble) return intersect_triangle<TriangleTest::kDouble>(ray, p0, p1, p2, t_max, hit);
  return intersect_triangle(ray, p0, p1, p2, t_max, hit);
}

}  // namespace shoal
