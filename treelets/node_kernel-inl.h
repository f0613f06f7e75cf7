// A ray against a quantised node, and the children it enters in order: without a branch on what is found, so that
// the steps of several rays overlap. Included once a target (foreach_target.h).
#if defined(SHOAL_TREELETS_NODE_KERNEL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SHOAL_TREELETS_NODE_KERNEL_INL_H
#undef SHOAL_TREELETS_NODE_KERNEL_INL_H
#else
#define SHOAL_TREELETS_NODE_KERNEL_INL_H
#endif

#include <hwy/highway.h>

#include "treelets/box_kernel-inl.h"
#include "treelets/treelet_layout.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

using I8 = hn::RebindToSigned<F8>;
using B8 = hn::Rebind<uint8_t, F8>;

/// Set in the key of a child that is entered; a key without it is zero. Below the sign, keys are those of entry_key().
inline constexpr uint32_t kEnteredBit = 0x80000000u;

/// The keys of lanes from `first` on of the node's children.
HWY_INLINE hn::Vec<U8> cross_node(const RaySpace& ray, const QuantizedNode& node, float t, size_t first) {
  static_assert(offsetof(QuantizedNode, hi) == offsetof(QuantizedNode, lo) + 24);
  static_assert(offsetof(QuantizedNode, exponent) == 12);
  // Along an axis: (origin + q * step) * slope + bias = q * (step * slope) + (origin * slope + bias).
  const hn::CappedTag<float, 4> f4;
  const hn::RebindToSigned<decltype(f4)> i4;
  HWY_ALIGN float slope[4], near_bias[4], far_bias[4];
  for (size_t axis = 0; axis < 4; axis += hn::Lanes(f4)) {
    const auto slopes = hn::Load(f4, ray.slope + axis), origin = hn::LoadU(f4, node.origin + axis);
    const auto exponents = hn::PromoteTo(i4, hn::LoadU(hn::Rebind<int8_t, decltype(f4)>(), node.exponent + axis));
    const auto steps = hn::BitCast(f4, hn::ShiftLeft<23>(hn::Add(exponents, hn::Set(i4, 127))));
    hn::Store(hn::Mul(steps, slopes), f4, slope + axis);
    hn::Store(hn::MulAdd(origin, slopes, hn::Load(f4, ray.near_bias + axis)), f4, near_bias + axis);
    hn::Store(hn::MulAdd(origin, slopes, hn::Load(f4, ray.far_bias + axis)), f4, far_bias + axis);
  }

  const F8 f;
  const U8 u;
  const uint8_t* planes = &node.lo[0][0] + first;
  const auto plane = [&](uint32_t side, uint32_t axis) HWY_ATTR {
    return hn::ConvertTo(f, hn::PromoteTo(I8(), hn::LoadU(B8(), planes + 24 * size_t{side} + 8 * axis)));
  };
  const BoxLanes boxes = cross_boxes(ray, t, slope, near_bias, far_bias, first, plane);
  const auto used = hn::Lt(hn::Iota(I8(), static_cast<int32_t>(first)), hn::Set(I8(), int32_t{node.child_count}));
  const auto entered = hn::And(boxes.entered, hn::RebindMask(f, used));
  return hn::IfThenElseZero(hn::RebindMask(u, entered), hn::Or(boxes.key, hn::Set(u, kEnteredBit)));
}

#if HWY_MAX_BYTES >= 32

template <int kStage>
HWY_INLINE hn::Vec<U8> sort_stage(hn::Vec<U8> v) {
  // Batcher's odd-even merge sort of 8 (Knuth, The Art of Computer Programming 3, 5.3.4): partners of each stage.
  HWY_ALIGN static constexpr uint32_t kPartner[6][8] = {{1, 0, 3, 2, 5, 4, 7, 6}, {2, 3, 0, 1, 6, 7, 4, 5},
                                                        {0, 2, 1, 3, 4, 6, 5, 7}, {4, 5, 6, 7, 0, 1, 2, 3},
                                                        {0, 1, 4, 5, 2, 3, 6, 7}, {0, 2, 1, 4, 3, 6, 5, 7}};
  HWY_ALIGN static constexpr uint32_t kUpper[6][8] = {{0, ~0u, 0, ~0u, 0, ~0u, 0, ~0u}, {0, 0, ~0u, ~0u, 0, 0, ~0u, ~0u},
                                                      {0, 0, ~0u, 0, 0, 0, ~0u, 0},     {0, 0, 0, 0, ~0u, ~0u, ~0u, ~0u},
                                                      {0, 0, 0, 0, ~0u, ~0u, 0, 0},     {0, 0, ~0u, 0, ~0u, 0, ~0u, 0}};
  const U8 u;
  const auto other = hn::TableLookupLanes(v, hn::IndicesFromVec(u, hn::Load(u, kPartner[kStage])));
  return hn::IfThenElse(hn::MaskFromVec(hn::Load(u, kUpper[kStage])), hn::Min(v, other), hn::Max(v, other));
}

/// Descending.
HWY_INLINE hn::Vec<U8> sort_lanes(hn::Vec<U8> v) {
  v = sort_stage<0>(v), v = sort_stage<1>(v), v = sort_stage<2>(v);
  return sort_stage<5>(sort_stage<4>(sort_stage<3>(v)));
}

/// Writes the keys of the children entered and their references, the nearest last, and returns how many there are.
/// Writes 8 of each, whatever the number.
HWY_INLINE uint32_t enter_children(const RaySpace& ray, const QuantizedNode& node, float t, uint32_t* keys,
                                   NodeRef* refs) {
  const U8 u;
  const auto sorted = sort_lanes(cross_node(ray, node, t, 0));
  const auto slots = hn::IndicesFromVec(u, hn::And(sorted, hn::Set(u, 7)));
  hn::StoreU(sorted, u, keys);
  hn::StoreU(hn::TableLookupLanes(hn::LoadU(u, node.child), slots), u, refs);
  return static_cast<uint32_t>(hn::CountTrue(u, hn::Ne(sorted, hn::Zero(u))));
}

#else

HWY_INLINE uint32_t enter_children(const RaySpace& ray, const QuantizedNode& node, float t, uint32_t* keys,
                                   NodeRef* refs) {
  const U8 u;
  HWY_ALIGN uint32_t all[8];
  for (size_t first = 0; first < 8; first += hn::Lanes(u)) hn::Store(cross_node(ray, node, t, first), u, all + first);
  uint32_t count = 0;
  for (uint32_t slot = 0; slot < node.child_count; ++slot) {
    if (all[slot] == 0) continue;
    uint32_t i = count++;
    for (; i > 0 && keys[i - 1] < all[slot]; --i) keys[i] = keys[i - 1], refs[i] = refs[i - 1];
    keys[i] = all[slot], refs[i] = node.child[slot];
  }
  return count;
}

#endif

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#endif
