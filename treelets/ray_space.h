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
// The boxes of nodes are tested with fewer operations (treelets/box_kernel-inl.h): plane * slope + bias, the grid of a
// quantised node multiplied out. What enters the triangle's own box (box_test.h) must enter every node above it, so the
// node's ray is wider by the errors of both, as positions. In units of u, of |o| and of B (R = |o| + B): the node 4 and
// 6 (moved origin, bias, origin * slope and q * (step * slope) where they are not fused, their sums, the grid plane
// that the packer evaluated in float), its enlargement of t_far 1 and 1, the triangle's box with its own 4 and 3: 9
// and 10, hence kNodePad = 12 u more.
// Slopes are inverse directions, held below 2^60 times the least of them: a box that the ray touches is left after at
// most 2 R along the longest axis, which a wider one bounds by 12 u R 2^60 along any other.
// Rays whose products could overflow or lose bits are `extreme` and go through box_test.h instead.
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
inline constexpr float kNodePad = 12 * kRoundingUnit;

/// 1 + 2 gamma(3) = 1 + 6u (1 + O(u)) (Ize 2013, "Robust BVH Ray Traversal", section 3), and one more rounding in
/// far_inverse: 7u, rounded up to a float.
inline constexpr float kFarScale = 0x1.000008p0f;

struct alignas(16) RaySpace {
  float origin[4];         ///< the fourth of each is unused
  float direction[4];
  float inverse[4];        ///< 1 / direction, clamped to +-FLT_MAX, so that (plane - origin) * inverse is never NaN
  float slope[4];          ///< of node tests: t = plane * slope + bias
  float near_bias[4];      ///< -(origin moved so that near planes come earlier) * slope
  float far_bias[4];       ///< -(origin moved so that far planes come later) * slope
  uint32_t negative[4];    ///< 1: the ray runs towards smaller coordinates: hi is the near plane
  uint32_t kx, ky, kz;     ///< kz: axis along which the direction is longest
  float shear_x, shear_y;  ///< d[kx] / d[kz], d[ky] / d[kz]
  float pad;               ///< of box_test.h
  bool extreme;            ///< slope and biases must not be used
};

inline float max_abs(const float v[3]) { return std::max({std::abs(v[0]), std::abs(v[1]), std::abs(v[2])}); }

/// Slopes are held below kMaxSlope times the least.
inline constexpr float kMaxSlope = 0x1p60f;
/// Of rays that are not extreme. A ray is in a box that it touches until 2 R slope at most, and by an axis along which it does
/// not move, whose inverse is held at 2^128, until 2 u R 2^128 at least (2 u R: what the pad has left), which is later then.
inline constexpr float kMostLeastSlope = 0x1p100f;
inline bool is_extreme(float largest_slope, float least_slope, float reach) {
  return !(largest_slope * reach < 0x1p100f && least_slope > 1 / kMaxSlope && least_slope < kMostLeastSlope &&
           reach > 0x1p-60f);
}

/// Sets the pads. `reach`: R above, max|origin| and the extent of what is traced.
inline void set_pad(RaySpace& ray, float pad, float reach) {
  ray.pad = pad;
  const float least = std::abs(ray.inverse[ray.kz]), most = least * kMaxSlope;
  const float node_pad = pad + kNodePad * reach;
  float largest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const float slope = std::min(std::max(ray.inverse[axis], -most), most);
    const float toward = ray.negative[axis] != 0 ? -node_pad : node_pad;
    ray.slope[axis] = slope;
    ray.near_bias[axis] = -((ray.origin[axis] + toward) * slope);
    ray.far_bias[axis] = -((ray.origin[axis] - toward) * slope);
    largest = std::max(largest, std::abs(slope));
  }
  ray.slope[3] = ray.near_bias[3] = ray.far_bias[3] = 0;
  ray.extreme = is_extreme(largest, least, reach);
}

/// Sets kx, ky, kz and the shear.
inline void set_axes(const Vec3& direction, RaySpace& ray) {
  const float ax = std::abs(direction.x), ay = std::abs(direction.y), az = std::abs(direction.z);
  const uint32_t x_longest = (ax > ay) & (ax > az), y_longest = !(ax > ay) & (ay > az);
  ray.kz = 2 - 2 * x_longest - y_longest;
  ray.kx = ray.kz == 2 ? 0 : ray.kz + 1;
  ray.ky = ray.kx == 2 ? 0 : ray.kx + 1;
  const float longest = direction[static_cast<int>(ray.kz)];
  ray.shear_x = direction[static_cast<int>(ray.kx)] / longest;
  ray.shear_y = direction[static_cast<int>(ray.ky)] / longest;
}

/// Everything but what set_pad() sets.
inline RaySpace prepare_ray(const Vec3& origin, const Vec3& direction) {
  constexpr float kMax = std::numeric_limits<float>::max();
  RaySpace ray;
  for (int axis = 0; axis < 3; ++axis) {
    ray.origin[axis] = origin[axis];
    ray.direction[axis] = direction[axis];
    ray.inverse[axis] = std::min(std::max(1.0f / direction[axis], -kMax), kMax);
    ray.negative[axis] = std::signbit(direction[axis]) ? 1 : 0;
  }
  ray.origin[3] = ray.direction[3] = ray.inverse[3] = 0;
  ray.negative[3] = 0;
  set_axes(direction, ray);
  return ray;
}

/// The pad of an object's space; `max_abs_coordinate` of the object.
inline float object_pad(const RaySpace& ray, float max_abs_coordinate) {
  return kObjectPad * (max_abs(ray.origin) + max_abs_coordinate) + std::numeric_limits<float>::min();
}

/// The ray in the space of an instance that stands still.
inline RaySpace to_still_space(const Ray& ray, const Instance& instance) {
  RaySpace object = instance.identity ? prepare_ray(ray.origin, ray.direction)
                                      : prepare_ray(instance.world_to_object.point(ray.origin),
                                                    instance.world_to_object.vector(ray.direction));
  set_pad(object, object_pad(object, instance.max_abs_coordinate),
          max_abs(object.origin) + instance.max_abs_coordinate);
  return object;
}

/// The ray in the space of an instance that moves. Not inline: what stands still pays a branch only.
RaySpace to_moving_space(const Ray& ray, const Instance& instance);

/// The ray in the space of `instance`, where it stands at the ray's time: t is preserved, the direction is not
/// normalised.
inline RaySpace to_object_space(const Ray& ray, const Instance& instance) {
  if (instance.moves()) [[unlikely]] return to_moving_space(ray, instance);
  return to_still_space(ray, instance);
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
