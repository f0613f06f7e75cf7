// Which resident pages go next. The page cache hands over all unpinned pages with their rank (io/eviction_policy.h); the
// order keeps the lowest ones and gives them out one by one until they are used up, so that a ranking of n pages serves
// many evictions.
//
// Properties and assumptions
//   order    smallest rank first, then least recent use, then smallest page id.
//   batch    one page up to kExactCount pages: the order is exact. Above, n / kBatchFraction pages a ranking: a
//            page that was used since is skipped by the cache, so least recent use stays exact; the rank may be stale
//            by that fraction of the resident pages.
//   threads  one at a time (the page cache's lock).
//   cost     kBatchFraction looks at a page an eviction, amortised.
#pragma once

#include <algorithm>
#include <cstdint>
#include <tuple>
#include <vector>

#include "io/page_file.h"

namespace shoal {

struct EvictionCandidate {
  uint64_t rank = 0;
  uint64_t last_use = 0;
  PageId page = kNoPage;

  bool operator<(const EvictionCandidate& other) const {
    return std::tie(rank, last_use, page) < std::tie(other.rank, other.last_use, other.page);
  }
};

class EvictionOrder {
 public:
  static constexpr size_t kExactCount = 512;
  static constexpr size_t kBatchFraction = 16;

  /// Starts a ranking: fill the list with every page that may go, then call rank().
  std::vector<EvictionCandidate>& start() {
    candidates_.clear();
    return candidates_;
  }

  void rank() {
    const size_t count = candidates_.size();
    const size_t batch = count <= kExactCount ? std::min<size_t>(count, 1) : count / kBatchFraction;
    const auto end = candidates_.begin() + static_cast<ptrdiff_t>(batch);
    if (batch < count) std::nth_element(candidates_.begin(), end, candidates_.end());
    candidates_.resize(batch);
    std::sort(candidates_.rbegin(), candidates_.rend());
    highest_rank_ = candidates_.empty() ? 0 : candidates_.front().rank;
  }

  bool empty() const { return candidates_.empty(); }
  /// Requires: not empty.
  const EvictionCandidate& next() const { return candidates_.back(); }
  EvictionCandidate take() {
    const EvictionCandidate next = candidates_.back();
    candidates_.pop_back();
    return next;
  }
  /// Of the last page of the ranking: who ranks higher by now has left the batch.
  uint64_t highest_rank() const { return highest_rank_; }

 private:
  std::vector<EvictionCandidate> candidates_;  // the next one last
  uint64_t highest_rank_ = 0;
};

}  // namespace shoal
