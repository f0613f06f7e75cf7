// Rays that leave surfaces, as the shader makes them: for tests of self-intersection. Header only.
#pragma once

#include <cmath>
#include <vector>

#include "engine/surface.h"
#include "tests/numerics/every_kernel.h"

namespace shoal::testing {

using DVec3 = glm::dvec3;

/// Where a ray ended, and how one leaves from there on the side of `toward`.
struct Departure {
  Vec3 origin, normal;  ///< the normal is that of the side, unit
  BoundedPoint point;
  float reach;          ///< offset_reach()
  Hit hit;
};

inline Surface surface_of(const TestScene& scene, const Ray& ray) {
  PathState path;
  path.origin = ray.origin, path.direction = ray.direction, path.t = ray.t, path.hit = ray.hit;
  return find_surface(path, scene.instances[ray.hit.instance], scene.pages[ray.hit.treelet].bytes(), {});
}

inline Departure depart(const Surface& surface, const Hit& hit, const Vec3& toward) {
  const Vec3 n = glm::dot(surface.geometric_normal, toward) < 0 ? -surface.geometric_normal : surface.geometric_normal;
  return {offset_point(surface.position, n), n, surface.position, offset_reach(surface.position, n), hit};
}

/// A direction that leaves a plane at this sine.
inline Vec3 leaving_direction(std::mt19937& random, const Vec3& normal, double sine) {
  DVec3 along;
  do {
    along = DVec3(random_vector(random));
    along -= DVec3(normal) * glm::dot(DVec3(normal), along);
  } while (glm::dot(along, along) < 0.01);
  along /= std::sqrt(glm::dot(along, along));
  return Vec3(along * std::sqrt(1 - sine * sine) + DVec3(normal) * sine);
}

/// A triangle where traversal has it, in double.
struct WorldTriangle {
  DVec3 p[3];
  uint32_t instance, primitive;
};

inline DVec3 exact_point(const Affine3& m, const Vec3& p) {
  return DVec3(m.column_x) * double{p.x} + DVec3(m.column_y) * double{p.y} + DVec3(m.column_z) * double{p.z} +
         DVec3(m.translation);
}

inline std::vector<WorldTriangle> world_triangles(const TestScene& scene) {
  std::vector<WorldTriangle> all;
  for (uint32_t i = 0; i < scene.instances.size(); ++i) {
    const Affine3& m = scene.instances[i].object_to_world;
    for (const TestTriangle& t : scene.objects[scene.instances[i].object]) {
      all.push_back({{exact_point(m, t.p[0]), exact_point(m, t.p[1]), exact_point(m, t.p[2])}, i, t.primitive});
    }
  }
  return all;
}

/// Closest point of a triangle (Ericson 2005, "Real-Time Collision Detection", 5.1.5): its distance.
inline double distance_to(const WorldTriangle& t, const DVec3& p) {
  const DVec3 ab = t.p[1] - t.p[0], ac = t.p[2] - t.p[0], ap = p - t.p[0];
  const double d1 = glm::dot(ab, ap), d2 = glm::dot(ac, ap);
  const auto length = [](const DVec3& v) { return std::sqrt(glm::dot(v, v)); };
  if (d1 <= 0 && d2 <= 0) return length(ap);
  const DVec3 bp = p - t.p[1];
  const double d3 = glm::dot(ab, bp), d4 = glm::dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return length(bp);
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return length(ap - ab * (d1 / (d1 - d3)));
  const DVec3 cp = p - t.p[2];
  const double d5 = glm::dot(ab, cp), d6 = glm::dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return length(cp);
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return length(ap - ac * (d2 / (d2 - d6)));
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return length(bp - (t.p[2] - t.p[1]) * ((d4 - d3) / (d4 - d3 + d5 - d6)));
  const double sum = 1 / (va + vb + vc);
  return length(ap - ab * (vb * sum) - ac * (vc * sum));
}

struct RobustHit {
  double t = 0;
  bool inside = false;  ///< well inside the triangle, not edge on, and before the ray: rounding cannot miss it
};

/// Where a line meets the plane of a triangle (Moeller and Trumbore 1997).
inline RobustHit robust_hit(const WorldTriangle& t, const DVec3& origin, const DVec3& direction) {
  const DVec3 e1 = t.p[1] - t.p[0], e2 = t.p[2] - t.p[0], n = glm::cross(e1, e2), s = origin - t.p[0];
  const double seen = -glm::dot(n, direction);
  const DVec3 q = glm::cross(s, direction);
  const double b1 = glm::dot(e2, q) / seen, b2 = -glm::dot(e1, q) / seen, at = glm::dot(n, s) / seen;
  const bool steep = std::abs(seen) > 1e-3 * std::sqrt(glm::dot(n, n) * glm::dot(direction, direction));
  return {at, steep && at > 0 && b1 > 1e-3 && b2 > 1e-3 && b1 + b2 < 1 - 1e-3};
}

}  // namespace shoal::testing
