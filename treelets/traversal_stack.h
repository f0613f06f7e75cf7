// The stack of one traversal inside a treelet: what is still to visit, the nearest on top. Fixed in size: at each of at
// most kMaxTreeletDepth levels at most 7 siblings wait.
#pragma once

#include "treelets/box_test.h"
#include "treelets/treelet_layout.h"

namespace shoal {

class TraversalStack {
 public:
  /// Pushes the children of one node that the ray enters so that the nearest is on top.
  void push(const uint32_t keys[8], const NodeRef child[8], uint32_t mask) {
    const uint32_t base = size_;
    for (; mask != 0; mask &= mask - 1) {
      const uint32_t slot = static_cast<uint32_t>(std::countr_zero(mask));
      const uint64_t entry = uint64_t{keys[slot]} << 32 | child[slot];
      uint32_t i = size_++;
      for (; i > base && entries_[i - 1] < entry; --i) entries_[i] = entries_[i - 1];
      entries_[i] = entry;
    }
  }
  /// The next child whose box begins at or before `t`; false when there is none.
  bool pop(float t, NodeRef& ref) {
    while (size_ > 0) {
      const uint64_t entry = entries_[--size_];
      ref = static_cast<NodeRef>(entry);
      if (key_t(static_cast<uint32_t>(entry >> 32)) <= t) return true;
    }
    return false;
  }

 private:
  uint32_t size_ = 0;
  uint64_t entries_[7 * kMaxTreeletDepth + 1];
};

}  // namespace shoal
