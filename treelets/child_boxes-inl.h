// The boxes of a node's children as floats, of the top tree or of a treelet, for traversals that test many rays
// against them. Included once a target (foreach_target.h).
#if defined(SHOAL_TREELETS_CHILD_BOXES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SHOAL_TREELETS_CHILD_BOXES_INL_H
#undef SHOAL_TREELETS_CHILD_BOXES_INL_H
#else
#define SHOAL_TREELETS_CHILD_BOXES_INL_H
#endif

#include <hwy/highway.h>

#include "treelets/node_kernel-inl.h"
#include "treelets/scene_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

struct ChildBoxes {
  const float *lo[3], *hi[3];  ///< 8 each, at addresses that vectors load from
  uint32_t refs[8];            ///< NodeRef, or of the top tree top_ref()
  uint32_t there = 0;          ///< slots with a child, a bit each

  /// Keeps a reference to the node.
  HWY_INLINE explicit ChildBoxes(const TopNode& node) {
    for (uint32_t axis = 0; axis < 3; ++axis) lo[axis] = node.lo[axis], hi[axis] = node.hi[axis];
    for (uint32_t slot = 0; slot < 8; ++slot) {
      refs[slot] = top_ref(node, slot);
      there |= (node.kind[slot] != ChildKind::kEmpty ? 1u : 0u) << slot;
    }
  }

  HWY_INLINE explicit ChildBoxes(const QuantizedNode& node) {
    const F8 f;
    for (uint32_t axis = 0; axis < 3; ++axis) {
      const auto origin = hn::Set(f, node.origin[axis]), step = hn::Set(f, power_of_two(node.exponent[axis]));
      for (size_t first = 0; first < 8; first += hn::Lanes(f)) {
        const auto l = hn::ConvertTo(f, hn::PromoteTo(I8(), hn::LoadU(B8(), node.lo[axis] + first)));
        const auto h = hn::ConvertTo(f, hn::PromoteTo(I8(), hn::LoadU(B8(), node.hi[axis] + first)));
        hn::Store(hn::MulAdd(l, step, origin), f, planes_[axis] + first);
        hn::Store(hn::MulAdd(h, step, origin), f, planes_[3 + axis] + first);
      }
      lo[axis] = planes_[axis], hi[axis] = planes_[3 + axis];
    }
    for (uint32_t slot = 0; slot < 8; ++slot) refs[slot] = node.child[slot];
    there = (1u << node.child_count) - 1;
  }
  ChildBoxes(const ChildBoxes&) = delete;
  ChildBoxes& operator=(const ChildBoxes&) = delete;

 private:
  alignas(64) float planes_[6][8];
};

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#endif
