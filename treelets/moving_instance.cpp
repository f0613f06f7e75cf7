#include "treelets/moving_instance.h"

#include <algorithm>
#include <cmath>

#include "treelets/ray_space.h"

namespace shoal {
namespace {

using DVec3 = glm::dvec3;

Vec3 between(const Vec3& a, const Vec3& b, float s) { return a * (1 - s) + b * s; }

Affine3 between(const Affine3& a, const Affine3& b, float s) {
  return {between(a.column_x, b.column_x, s), between(a.column_y, b.column_y, s), between(a.column_z, b.column_z, s),
          between(a.translation, b.translation, s)};
}

bool finite(const Vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

/// False where there is no inverse in float.
bool invert(const Affine3& m, Affine3& inverse) {
  const DVec3 x(m.column_x), y(m.column_y), z(m.column_z);
  const DVec3 yz = glm::cross(y, z), zx = glm::cross(z, x), xy = glm::cross(x, y);
  const double determinant = glm::dot(x, yz);
  // Rows of the inverse.
  const DVec3 r0 = yz / determinant, r1 = zx / determinant, r2 = xy / determinant;
  const DVec3 t(m.translation);
  inverse.column_x = Vec3(DVec3(r0.x, r1.x, r2.x));
  inverse.column_y = Vec3(DVec3(r0.y, r1.y, r2.y));
  inverse.column_z = Vec3(DVec3(r0.z, r1.z, r2.z));
  inverse.translation = Vec3(-DVec3(glm::dot(r0, t), glm::dot(r1, t), glm::dot(r2, t)));
  return finite(inverse.column_x) && finite(inverse.column_y) && finite(inverse.column_z) &&
         finite(inverse.translation);
}

}  // namespace

RaySpace to_moving_space(const Ray& ray, const Instance& instance) {
  return to_still_space(ray, instance_at(instance, ray.time()));
}

Instance instance_at(const Instance& instance, float time) {
  const Instance* const keys = &instance + instance.motion_rows;
  const float place = time * static_cast<float>(instance.key_count - 1);
  const uint32_t key = std::min(static_cast<uint32_t>(place), instance.key_count - 2);
  Instance now = instance;
  now.motion_rows = now.key_count = 0;
  const float part = place - static_cast<float>(key);
  if (part > 0 && !stays(keys[key])) {
    now.object_to_world = between(keys[key].object_to_world, keys[key + 1].object_to_world, part);
    if (invert(now.object_to_world, now.world_to_object)) return now;
  }
  now.object_to_world = keys[key].object_to_world;
  now.world_to_object = keys[key].world_to_object;
  return now;
}

}  // namespace shoal
