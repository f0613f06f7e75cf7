// full: a queue is flushed when its capacity is reached; what is left in partly filled queues when no new rays can
// come is flushed fullest first.
#include "queues/drain_policy.h"

#include <algorithm>

namespace shoal {
namespace {

class FullPolicy final : public DrainPolicy {
 public:
  /// At least 1: an empty queue must never count as full, or it would be chosen for ever.
  explicit FullPolicy(uint32_t queue_capacity) : queue_capacity_(std::max(queue_capacity, 1u)) {}

  TreeletId choose(const WaitingView& view, bool more_coming) override {
    TreeletId best = kNoIndex;
    uint32_t most = 0;
    for (TreeletId id = 0; id < view.treelet_count(); ++id) {
      const uint32_t waiting = view.waiting(id);
      if (waiting >= queue_capacity_) return id;
      if (waiting > most) most = waiting, best = id;
    }
    return more_coming ? kNoIndex : best;
  }

 private:
  uint32_t queue_capacity_;
};

}  // namespace

std::unique_ptr<DrainPolicy> make_full_policy(uint32_t queue_capacity) {
  return std::make_unique<FullPolicy>(queue_capacity);
}

}  // namespace shoal
