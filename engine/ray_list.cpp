#include "engine/ray_list.h"

#include <cmath>

#include "treelets/moving_instance.h"
#include "treelets/trace_treelet.h"

namespace shoal {
namespace {

bool finite(const Vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

/// Where the ray begins; in double, so that it is rounded once.
Vec3 start_of(const QueryRay& ray) {
  if (ray.t_min == 0) return ray.origin;
  return Vec3(glm::dvec3(ray.origin) + double{ray.t_min} * glm::dvec3(ray.direction));
}

bool can_be_traced(const QueryRay& ray) {
  return finite(ray.origin) && finite(ray.direction) && ray.direction != Vec3(0) && std::isfinite(ray.t_min) &&
         !std::isnan(ray.t_max) && finite(start_of(ray));
}

/// The length of a ray that enters no box.
constexpr float kRayNowhere = -1;

/// From the start that start_of() gives.
float length_of(const QueryRay& ray) {
  if (!(ray.t_max > ray.t_min)) return kRayNowhere;
  if (ray.t_max >= kRayInfinity) return kRayInfinity;
  return static_cast<float>(std::min(double{ray.t_max} - ray.t_min, double{kRayInfinity}));
}

}  // namespace

Ray RayList::begin(uint64_t index, PathState& path) {
  const QueryRay asked = rays_.ray(index);
  Ray ray;
  ray.direction = Vec3(0, 0, 1);
  ray.t = kRayNowhere;
  if (can_be_traced(asked)) {
    ray.origin = start_of(asked), ray.direction = asked.direction;
    ray.t = length_of(asked);
  } else {
    refused_.fetch_add(1, std::memory_order_relaxed);
  }
  ray.alpha_seed = questions_.coverage ? asked.seed : asked.seed | QueryRay::kEveryTriangle;
  path.pixel = static_cast<uint32_t>(index);
  path.sample = 0;
  path.bounce = 0;
  path.seeks = 0;
  path.flags = questions_.points && !any_hit() ? uint32_t{kPathGoesOn} : 0u;
  path.origin = ray.origin;
  path.direction = ray.direction;
  path.hit = Hit{};
  path.pending.store(1, std::memory_order_relaxed);
  return ray;
}

void RayList::finish(const Ray& ray, PathState& path) {
  path.hit = ray.hit;
  path.t = ray.t;
  if (!ray.hit.valid()) path.flags &= ~uint32_t{kPathGoesOn};
  if ((path.flags & kPathGoesOn) != 0) return;
  RayHit hit;
  if (ray.any_hit()) {
    hit.hit = ray.hit.valid();  // which triangle is met first depends on the order
  } else if (ray.hit.valid()) {
    hit = closest_hit(path, rays_.ray(path.pixel));
  }
  rays_.answer(path.pixel, hit);
}

RayHit RayList::closest_hit(const PathState& path, const QueryRay& asked) const {
  RayHit hit;
  hit.hit = true;
  hit.t = asked.t_min == 0 ? path.t : static_cast<float>(double{asked.t_min} + path.t);
  hit.instance = path.hit.instance;
  hit.object = objects_.of(path.hit);
  hit.primitive = path.hit.primitive;
  return hit;
}

void RayList::find_point(const PathState& path, const TopTree& tree, std::span<const std::byte> geometry) {
  const QueryRay asked = rays_.ray(path.pixel);
  const TreeletTriangle triangle = find_triangle(geometry, path.hit.slot);
  Ray ray;
  ray.origin = path.origin, ray.direction = path.direction, ray.t = path.t;
  ray.alpha_seed = asked.seed;
  ray.hit = path.hit;
  const Instance& instance = tree.instance(path.hit.instance);
  const TriangleTest test = questions_.triangle_test;
  const TrianglePoint at = instance.moves() ? intersect_known(ray, instance_at(instance, ray.time()), triangle, test)
                                            : intersect_known(ray, instance, triangle, test);
  RayHit hit = closest_hit(path, asked);
  hit.u = at.b1, hit.v = at.b2;
  rays_.answer(path.pixel, hit);
}

}  // namespace shoal
