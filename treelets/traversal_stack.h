// The stack of one scalar traversal inside a treelet: what is still to visit, the nearest on top. Fixed in size: at each
// of at most kMaxTreeletDepth levels at most 7 siblings wait.
#pragma once

#include <utility>

#include "treelets/box_test.h"
#include "treelets/treelet_layout.h"

namespace shoal {

class TraversalStack {
 public:
  /// Goes on to the nearest of the children of one node that the ray enters (a bit each in `mask`) and leaves the
  /// others waiting; false when there is none.
  bool enter(const uint32_t keys[8], const NodeRef child[8], uint32_t mask, NodeRef& next) {
    if (mask == 0) return false;
    const auto take = [&] {
      const uint32_t slot = static_cast<uint32_t>(std::countr_zero(mask));
      mask &= mask - 1;
      return uint64_t{keys[slot]} << 32 | child[slot];
    };
    uint64_t nearest = take();
    const uint32_t base = size_;
    while (mask != 0) {
      uint64_t entry = take();
      if (entry < nearest) std::swap(entry, nearest);
      uint32_t i = size_++;
      for (; i > base && entries_[i - 1] < entry; --i) entries_[i] = entries_[i - 1];
      entries_[i] = entry;
    }
    next = static_cast<NodeRef>(nearest);
    return true;
  }
  /// The next child whose box begins at or before `t`; false when there is none.
  bool pop(float t, NodeRef& next) {
    while (size_ > 0) {
      const uint64_t entry = entries_[--size_];
      next = static_cast<NodeRef>(entry);
      if (key_t(static_cast<uint32_t>(entry >> 32)) <= t) return true;
    }
    return false;
  }

 private:
  uint32_t size_ = 0;
  uint64_t entries_[7 * kMaxTreeletDepth + 1];
};

}  // namespace shoal
