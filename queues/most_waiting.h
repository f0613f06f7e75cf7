// The few treelets with most work, in order: what several policies begin with. Called by queues only. Cost: linear.
#pragma once

#include <algorithm>
#include <vector>

#include "queues/drain_policy.h"

namespace shoal {

/// Leaves the `count` treelets that most wait for, most first, ties to the smaller id.
inline void keep_most_waiting(std::vector<WaitingTreelet>& work, size_t count) {
  const auto more = [](const WaitingTreelet& a, const WaitingTreelet& b) {
    return a.waiting != b.waiting ? a.waiting > b.waiting : a.treelet < b.treelet;
  };
  if (count < work.size()) {
    std::nth_element(work.begin(), work.begin() + static_cast<ptrdiff_t>(count), work.end(), more);
    work.resize(count);
  }
  std::sort(work.begin(), work.end(), more);
}

/// What of `drain` is not resident is wanted ahead, in the same order.
inline void load_what_is_drained(std::span<const WaitingTreelet> drain, size_t limit, Decision& decision) {
  for (const WaitingTreelet& w : drain) {
    if (!w.resident && decision.load.size() < limit) decision.load.push_back(w.treelet);
  }
}

}  // namespace shoal
