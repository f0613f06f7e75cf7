// What a ray meets in exact arithmetic, and how far the triangle test may be from that: the bounds of docs/numerics.md.
#pragma once

#include <array>
#include <vector>

#include "tests/numerics/exact_number.h"
#include "tests/support/hand_made_page.h"
#include "treelets/ray_space.h"
#include "treelets/triangle_test_kind.h"

namespace shoal::testing {

using Exact3 = std::array<Exact, 3>;

inline Exact3 exact_difference(const Vec3& a, const Vec3& b) {
  return {Exact(a.x) - Exact(b.x), Exact(a.y) - Exact(b.y), Exact(a.z) - Exact(b.z)};
}
inline Exact3 cross(const Exact3& a, const Exact3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline Exact dot(const Exact3& a, const Exact3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// Where the line of a ray meets a triangle, borders included.
struct ExactHit {
  bool met = false;
  Exact above, below;  ///< t = above / below; below > 0
  double t() const { return above.to_double() / below.to_double(); }
};

inline bool comes_first(const ExactHit& a, const ExactHit& b) {
  return compare(a.above * b.below, b.above * a.below) < 0;
}

inline ExactHit meet_exactly(const Vec3& origin, const Vec3& direction, const Vec3 p[3]) {
  const Exact3 d{Exact(direction.x), Exact(direction.y), Exact(direction.z)};
  const Exact3 a = exact_difference(p[0], origin), b = exact_difference(p[1], origin),
               c = exact_difference(p[2], origin);
  const Exact3 bc = cross(b, c);
  const Exact u = dot(d, bc), v = dot(d, cross(c, a)), w = dot(d, cross(a, b));
  ExactHit hit;
  const bool negative = u.sign() < 0 || v.sign() < 0 || w.sign() < 0;
  const bool positive = u.sign() > 0 || v.sign() > 0 || w.sign() > 0;
  hit.met = negative != positive;
  hit.above = dot(a, bc), hit.below = u + v + w;
  if (hit.below.sign() < 0) hit.above = -hit.above, hit.below = -hit.below;
  return hit;
}

/// The ray and a triangle as the ray sees it: sheared along its longest axis, in double, whose own errors are a part in
/// 2^28 of the bounds below.
struct SeenTriangle {
  double x[3], y[3], z[3];
  double dz;      ///< the direction along that axis
  double reach;   ///< R of treelets/ray_space.h
  double corner;  ///< what rounding moves a corner by, an axis, seen so

  SeenTriangle(const RaySpace& ray, const Vec3 p[3], float largest_coordinate, TriangleTest test) {
    dz = ray.direction[ray.kz];
    const double shear_x = ray.direction[ray.kx] / dz, shear_y = ray.direction[ray.ky] / dz;
    for (int k = 0; k < 3; ++k) {
      z[k] = double{p[k][ray.kz]} - ray.origin[ray.kz];
      x[k] = (double{p[k][ray.kx]} - ray.origin[ray.kx]) - shear_x * z[k];
      y[k] = (double{p[k][ray.ky]} - ray.origin[ray.ky]) - shear_y * z[k];
    }
    reach = double{max_abs(ray.origin)} + largest_coordinate;
    const double unit = test == TriangleTest::kDouble ? 0x1p-53 : 0x1p-24;
    // 6 u R, terms of order u^2, and products that round to denormal numbers.
    corner = 6.001 * unit * reach + (test == TriangleTest::kDouble ? 0 : 0x1p-146) + 0x1p-50 * reach;
  }

  /// Of the line of the ray, which is seen as the origin, from the border of the triangle.
  double distance_to_border() const {
    double least = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 3; ++k) {
      const int n = (k + 1) % 3;
      const double ex = x[n] - x[k], ey = y[n] - y[k], length = ex * ex + ey * ey;
      const double along = length > 0 ? std::clamp(-(x[k] * ex + y[k] * ey) / length, 0.0, 1.0) : 0.0;
      least = std::min(least, std::hypot(x[k] + along * ex, y[k] + along * ey));
    }
    return least;
  }
  /// Nearer to the border than this the test may take a hit for a miss or a miss for a hit.
  double border_bound() const { return std::sqrt(2.0) * corner; }
  /// Of t, at a `t` that the triangle is met at.
  double t_bound(double t) const {
    const double x1 = x[1] - x[0], y1 = y[1] - y[0], z1 = z[1] - z[0], x2 = x[2] - x[0], y2 = y[2] - y[0],
                 z2 = z[2] - z[0], area = x1 * y2 - x2 * y1;
    const double slope = (std::abs(z1 * y2 - z2 * y1) + std::abs(x1 * z2 - x2 * z1)) / std::abs(area);
    const double thick = std::max({z[0], z[1], z[2]}) - std::min({z[0], z[1], z[2]});
    // By the slope of its plane, or, edge on, by its own box with the pads on both sides (t is held inside it).
    const double flat = corner * slope + 0x1p-24 * reach, box = thick + 26 * 0x1p-24 * reach + 0x1p-125;
    const double plane = std::isnan(flat) ? box : std::min(flat, box);
    return plane / std::abs(dz) + 1.01 * 0x1p-24 * std::abs(t) + 0x1p-148;
  }
};

}  // namespace shoal::testing
