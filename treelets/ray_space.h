// A ray prepared for one space (the world, or an instance's object space): what the box and triangle tests need of
// it, computed once. Made by TopTree and trace_treelet, kept by RayContext. Plain values; cost: about 25 ns.
//
// The pads below are bounds on the error of our own arithmetic. With u = 2^-24 (rounding of one float operation),
// R = max|origin| + B, B the largest absolute coordinate of the object:
//
// - triangle test (Woop, Benthin & Wald 2013): translation errs by u R, the shear S by u |S| with |S| <= 1, so the
//   sheared vertex p_x - S p_z errs by (1 + 3 + 2) u R = 6 u R. An accepted ray meets a triangle that is the true
//   one with its corners moved by at most 6 u R an axis;
// - box test: origin +- pad, (plane - origin), 1/d and the product, each rounded once: 4 u R as a position.
//
// So boxes widened by 10 u R hold every hit that the triangle test accepts; kObjectPad = 12 u also covers the
// rounding of the pad itself and the terms of order u^2. FLT_MIN is added for products that underflow.
//
// The tree over instances is tested in world space, the hit was decided in object space. With M the object to world
// matrix, L its linear part, T its translation, N the stored inverse, K >= ||L| |N|| (Instance::transform_error)
// and W <= E the extent of the instance in the world, E = |T| + |L| B (row sums), the world point of a hit errs by
//
// - 5 u K (|o| + |T|), the transformed origin: four products and sums, entries of N rounded once (Higham
// 2002, 3.5);
// - 4 u K (W + |o|), the transformed direction, times t <= (W + |o|) / |d|;
// - 22 u (K (|o| + |T|) + |L| B), the object's pad 12 u, and 10 u of slab arithmetic and its enlargement kFarScale;
// - 4 u E + 4 u (|o| + W), the corners of the instance's box, and the slabs in world space;
//
// which is below 40 u K (|o| + E): kWorldPad.
#pragma once

#include "treelets/ray.h"
#include "treelets/top_tree.h"
#include "treelets/vector.h"

namespace shoal {

inline constexpr float kRoundingUnit = 0x1p-24f;
inline constexpr float kObjectPad = 12 * kRoundingUnit;
inline constexpr float kWorldPad = 40 * kRoundingUnit;

/// 1 + 2 gamma(3) = 1 + 6u (1 + O(u)) (Ize 2013, "Robust BVH Ray Traversal", section 3), and one more rounding in
/// far_inverse: 7u, rounded up to a float.
inline constexpr float kFarScale = 0x1.000008p0f;

struct RaySpace {
  float origin[3];
  float direction[3];
  float inverse[3];        ///< 1 / direction, clamped to +-FLT_MAX, so that (plane - origin) * inverse is never NaN
  float far_inverse[3];    ///< inverse * kFarScale, clamped alike
  float near_origin[3];    ///< origin moved by pad so that near planes come earlier
  float far_origin[3];     ///< origin moved by pad so that far planes come later
  uint32_t negative[3];    ///< 1: the ray runs towards smaller coordinates: hi is the near plane
  uint32_t kx, ky, kz;     ///< kz: axis along which the direction is longest
  float shear_x, shear_y;  ///< d[kx] / d[kz], d[ky] / d[kz]
  float pad;
};

inline float max_abs(const float v[3]) { return std::max({std::abs(v[0]), std::abs(v[1]), std::abs(v[2])}); }

inline void set_pad(RaySpace& ray, float pad) {
  ray.pad = pad;
  for (int axis = 0; axis < 3; ++axis) {
    const float toward = ray.negative[axis] ? -pad : pad;
    ray.near_origin[axis] = ray.origin[axis] + toward;
    ray.far_origin[axis] = ray.origin[axis] - toward;
  }
}

/// Everything but the pad.
inline RaySpace prepare_ray(const Vec3& origin, const Vec3& direction) {
  constexpr float kMax = std::numeric_limits<float>::max();
  RaySpace ray;
  for (int axis = 0; axis < 3; ++axis) {
    ray.origin[axis] = origin[axis];
    ray.direction[axis] = direction[axis];
    ray.inverse[axis] = std::min(std::max(1.0f / direction[axis], -kMax), kMax);
    ray.far_inverse[axis] = std::min(std::max(ray.inverse[axis] * kFarScale, -kMax), kMax);
    ray.negative[axis] = std::signbit(direction[axis]) ? 1 : 0;
  }
  const float ax = std::abs(direction.x), ay = std::abs(direction.y), az = std::abs(direction.z);
  ray.kz = ax > ay ? (ax > az ? 0 : 2) : (ay > az ? 1 : 2);
  ray.kx = ray.kz == 2 ? 0 : ray.kz + 1;
  ray.ky = ray.kx == 2 ? 0 : ray.kx + 1;
  ray.shear_x = ray.direction[ray.kx] / ray.direction[ray.kz];
  ray.shear_y = ray.direction[ray.ky] / ray.direction[ray.kz];
  return ray;
}

/// The pad of an object's space; `max_abs_coordinate` of the object.
inline float object_pad(const RaySpace& ray, float max_abs_coordinate) {
  return kObjectPad * (max_abs(ray.origin) + max_abs_coordinate) + std::numeric_limits<float>::min();
}

/// The ray in the space of `instance`: t is preserved, the direction is not normalised.
inline RaySpace to_object_space(const Ray& ray, const Instance& instance) {
  RaySpace object = instance.identity ? prepare_ray(ray.origin, ray.direction)
                                      : prepare_ray(instance.world_to_object.point(ray.origin),
                                                    instance.world_to_object.vector(ray.direction));
  set_pad(object, object_pad(object, instance.max_abs_coordinate));
  return object;
}

/// What a worker keeps of the ray in hand between calls, so that one ray's transforms and reciprocals are computed
/// once a space. Requires: reset() before another ray, or another origin or direction.
struct RayContext {
  RaySpace world, object;
  uint32_t object_instance = kNoIndex;  ///< whose space `object` is; kNoIndex: not prepared
  bool world_ready = false;

  void reset() { object_instance = kNoIndex, world_ready = false; }
  const RaySpace& object_space(const Ray& ray, const Instance& instance) {
    if (object_instance != ray.instance) {
      object = to_object_space(ray, instance);
      object_instance = ray.instance;
    }
    return object;
  }
};

}  // namespace shoal
