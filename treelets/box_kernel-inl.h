// The ray against 8 boxes at once, on every instruction set of Highway: t = plane * slope + bias, conservative with
// respect to box_test.h (ray_space.h says why, fused or not). Included once a target by the kernels (foreach_target.h).
#if defined(SHOAL_TREELETS_BOX_KERNEL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SHOAL_TREELETS_BOX_KERNEL_INL_H
#undef SHOAL_TREELETS_BOX_KERNEL_INL_H
#else
#define SHOAL_TREELETS_BOX_KERNEL_INL_H
#endif

#include <hwy/highway.h>

#include "treelets/box_test.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using F8 = hn::CappedTag<float, 8>;
using U8 = hn::RebindToUnsigned<F8>;

struct BoxLanes {
  hn::Vec<U8> key;       ///< entry_key()
  hn::Mask<F8> entered;  ///< at or before t
};

/// Lanes from `first` on of 8 boxes whose planes `plane(side, axis)` gives (side 0: lo, 1: hi); t of a plane is
/// plane * slope[axis] + bias[axis]. Requires: not ray.extreme.
template <class Plane>
HWY_INLINE BoxLanes cross_boxes(const RaySpace& ray, float t, const float* slope, const float* near_bias,
                                const float* far_bias, size_t first, const Plane& plane) {
  const F8 f;
  const U8 u;
  const auto near = [&](uint32_t axis) HWY_ATTR {
    return hn::MulAdd(plane(ray.negative[axis], axis), hn::Set(f, slope[axis]), hn::Set(f, near_bias[axis]));
  };
  const auto far = [&](uint32_t axis) HWY_ATTR {
    return hn::MulAdd(plane(ray.negative[axis] ^ 1, axis), hn::Set(f, slope[axis]), hn::Set(f, far_bias[axis]));
  };
  const auto t_near = hn::Max(hn::Max(near(1), near(0)), hn::Max(near(2), hn::Zero(f)));
  const auto t_far = hn::Mul(hn::Min(far(2), hn::Min(far(1), far(0))), hn::Set(f, kFarScale));
  const auto key =
      hn::Or(hn::And(hn::BitCast(u, t_near), hn::Set(u, kKeyMask)), hn::Iota(u, static_cast<uint32_t>(first)));
  return {key, hn::And(hn::Le(t_near, t_far), hn::Le(t_near, hn::Set(f, t)))};
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#endif
