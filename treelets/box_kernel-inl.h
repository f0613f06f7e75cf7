// The ray against 8 boxes at once, on every instruction set of Highway: the operations of cross_box() in
// box_test.h, in its order, without fusing. Included once a target by the kernels (foreach_target.h).
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

/// Tests the 8 boxes whose planes `plane(side, axis, first)` gives (side 0: lo, 1: hi; lanes from `first` on).
/// Fills `keys` (entry_key) for all of them and returns the mask of those entered at or before `t`.
template <class Plane>
HWY_INLINE uint32_t cross_boxes(const RaySpace& ray, float t, const Plane& plane, uint32_t keys[8]) {
  const F8 f;
  const U8 u;
  uint32_t mask = 0;
  for (size_t first = 0; first < 8; first += hn::Lanes(f)) {
    const auto near = [&](uint32_t axis) HWY_ATTR {
      return hn::Mul(hn::Sub(plane(ray.negative[axis], axis, first), hn::Set(f, ray.near_origin[axis])),
                     hn::Set(f, ray.inverse[axis]));
    };
    const auto far = [&](uint32_t axis) HWY_ATTR {
      return hn::Mul(hn::Sub(plane(ray.negative[axis] ^ 1, axis, first), hn::Set(f, ray.far_origin[axis])),
                     hn::Set(f, ray.far_inverse[axis]));
    };
    const auto t_near = hn::Max(hn::Max(near(1), near(0)), hn::Max(near(2), hn::Zero(f)));
    const auto t_far = hn::Min(far(2), hn::Min(far(1), far(0)));
    const auto entered = hn::And(hn::Le(t_near, t_far), hn::Le(t_near, hn::Set(f, t)));
    const auto key =
        hn::Or(hn::And(hn::BitCast(u, t_near), hn::Set(u, kKeyMask)), hn::Iota(u, static_cast<uint32_t>(first)));
    hn::StoreU(key, u, keys + first);
    uint8_t bits[8] = {};
    hn::StoreMaskBits(f, entered, bits);
    mask |= uint32_t{bits[0]} << first;
  }
  return mask;
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#endif
