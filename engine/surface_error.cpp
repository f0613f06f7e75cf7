#include "engine/surface_error.h"

#include <bit>

namespace shoal {
namespace {

/// |linear part| times v, for v >= 0.
Vec3 absolute_vector(const Affine3& m, const Vec3& v) {
  return glm::abs(m.column_x) * v.x + glm::abs(m.column_y) * v.y + glm::abs(m.column_z) * v.z;
}

/// Rounding of Affine3::point: gamma(3) (|M| |p| + |t|), PBRT 6.8.3.
Vec3 transform_error(const Affine3& m, const Vec3& p, float gamma) {
  return gamma * (absolute_vector(m, glm::abs(p)) + glm::abs(m.translation));
}

/// The next float away from zero in the direction of `sign`; infinities and NaN stay.
float next_float(float x, bool up) {
  if (!(std::abs(x) <= std::numeric_limits<float>::max())) return x;
  if (x == 0) return up ? 0x1p-149f : -0x1p-149f;
  const uint32_t bits = std::bit_cast<uint32_t>(x);
  return std::bit_cast<float>((x > 0) == up ? bits + 1 : bits - 1);
}

}  // namespace

BoundedPoint point_on_triangle(const Vec3& p0, const Vec3& p1, const Vec3& p2, float b1, float b2) {
  const Vec3 step1 = (p1 - p0) * b1, step2 = (p2 - p0) * b2;
  // Roundings on the way: two in each step, two sums; one more because the bound is made of rounded steps.
  // Traversal rounds the corners again when it takes them relative to a ray's origin and shears them (Woop 2013):
  // the plane that it tests lies within gamma(4) of the largest corner distance, in any direction.
  const Vec3 rounding = gamma_bound(5) * (glm::abs(p0) + glm::abs(step1) + glm::abs(step2));
  const Vec3 p = p0 + step1 + step2;
  const Vec3 reach = glm::max(glm::max(glm::abs(p0 - p), glm::abs(p1 - p)), glm::abs(p2 - p));
  const float shear = gamma_bound(5) * (reach.x + reach.y + reach.z);
  return {p, rounding + Vec3(shear)};
}

Vec3 instance_error(const Vec3& world_point, const Instance& instance) {
  if (instance.identity != 0) return Vec3(0);
  // World to object: gamma(3), and one rounding of each element of the inverse; then seen in world space.
  const Vec3 there = transform_error(instance.world_to_object, world_point, gamma_bound(5));
  const Vec3 object_point = instance.world_to_object.point(world_point);
  return absolute_vector(instance.object_to_world, there) +
         transform_error(instance.object_to_world, object_point, gamma_bound(4));
}

BoundedPoint to_world(const BoundedPoint& object_point, const Instance& instance) {
  if (instance.identity != 0) return object_point;
  const Vec3 p = instance.object_to_world.point(object_point.point);
  return {p, (1 + gamma_bound(4)) * absolute_vector(instance.object_to_world, object_point.error) +
                 instance_error(p, instance)};
}

BoundedPoint ray_end(const BoundedPoint& target, const Vec3& origin, const Instance* instance) {
  BoundedPoint end = target;
  end.error += gamma_bound(6) * glm::abs(target.point - origin);
  // Origin and direction are transformed each; the direction is at most as long as both ends' vectors together.
  if (instance != nullptr) {
    end.error += 2.0f * (instance_error(origin, *instance) + instance_error(target.point, *instance));
  }
  return end;
}

Vec3 offset_point(const BoundedPoint& p, const Vec3& normal) {
  const Vec3 offset = glm::dot(glm::abs(normal), p.error) * normal;
  Vec3 moved = p.point + offset;
  for (int axis = 0; axis < 3; ++axis) {
    if (offset[axis] != 0) moved[axis] = next_float(moved[axis], offset[axis] > 0);
  }
  return moved;
}

float offset_reach(const BoundedPoint& p, const Vec3& normal) {
  const Vec3 n = glm::abs(normal);
  const float error = glm::dot(n, p.error);
  // The point may lie above the surface by its error, and is moved by as much. Each coordinate is rounded once and then
  // moved by one number: a half and one unit in the last place, 3 u of it. Roundings of all this: gamma(8).
  const float moved = glm::dot(n, glm::abs(p.point) + error * n);
  return (1 + gamma_bound(8)) * (2 * error + gamma_bound(3) * moved) + 3 * std::numeric_limits<float>::denorm_min();
}

}  // namespace shoal
