// The ray-box test: three slabs (Kay & Kajiya 1986) with the ray widened by RaySpace::pad and the far results
// enlarged by kFarScale (Ize 2013). Scalar form: the test of a triangle's own box, and of nodes by the scalar traversal.
// The SIMD kernels test nodes with fewer operations and a wider ray (ray_space.h).
//
// Monotone: every operation is a rounded monotone function of the planes. So if box A lies inside box B, then
// t_near(B) <= t_near(A) and t_far(A) <= t_far(B) in the computed values, and what enters A enters B. A hit counts
// only if the triangle's own box is entered and its t is clamped to that box's span; hence every box above it is
// entered too, and the shape of the BVH cannot change the picture.
//
// Along an axis whose inverse is held at the largest float (a component that is zero, or denormal) a ray whose t are as
// large would leave the box too early. There the far result of an extreme ray is multiplied once more: beyond every t, or
// below 0.
#pragma once

#include <bit>

#include "treelets/ray_space.h"

namespace shoal {

struct BoxSpan {
  float t_near;  ///< >= 0
  float t_far;
  /// Entered at or before `t`: a box that begins at exactly t is entered.
  bool entered(float t) const { return t_near <= std::min(t_far, t); }
};

inline BoxSpan cross_box(const RaySpace& ray, const float lo[3], const float hi[3]) {
  constexpr float kMax = std::numeric_limits<float>::max();
  float near[3], far[3];
  for (int axis = 0; axis < 3; ++axis) {
    const float near_plane = ray.negative[axis] ? hi[axis] : lo[axis];
    const float far_plane = ray.negative[axis] ? lo[axis] : hi[axis];
    const float toward = ray.negative[axis] ? -ray.pad : ray.pad;
    const float far_inverse = std::min(std::max(ray.inverse[axis] * kFarScale, -kMax), kMax);
    near[axis] = (near_plane - (ray.origin[axis] + toward)) * ray.inverse[axis];
    far[axis] = (far_plane - (ray.origin[axis] - toward)) * far_inverse;
    if (ray.extreme && std::abs(ray.inverse[axis]) == kMax) far[axis] *= kMax;
  }
  BoxSpan span;
  span.t_near = std::max(0.0f, std::max(near[2], std::max(near[1], near[0])));
  span.t_far = std::min(std::min(far[2], std::min(far[1], far[0])), kMax);
  return span;
}

/// The least exponent of a QuantizedNode: 2^exponent is a normal number (check_treelet).
inline constexpr int kMinGridPower = -126;

/// 2^exponent. Requires: exponent >= kMinGridPower.
inline float power_of_two(int8_t exponent) {
  return std::bit_cast<float>(static_cast<uint32_t>(exponent + 127) << 23);
}

/// A plane of a QuantizedNode: an exact product and one rounded sum, hence monotone in q.
inline float dequantize(float origin, float step, uint8_t q) { return origin + static_cast<float>(q) * step; }

/// The order in which children are entered: t of entry without its last three bits, then slot. As integers, so that
/// it is total whatever the ray. Requires: t_near >= 0.
inline constexpr uint32_t kKeyMask = 0x7ffffff8u;  // also clears the sign of -0
inline uint32_t entry_key(float t_near, uint32_t slot) {
  return (std::bit_cast<uint32_t>(t_near) & kKeyMask) | slot;
}
inline float key_t(uint32_t key) { return std::bit_cast<float>(key & kKeyMask); }

}  // namespace shoal
