// fullest: the treelet that most rays and paths wait for; ties go to the smaller id.
#include "queues/drain_policy.h"

namespace shoal {
namespace {

class FullestPolicy final : public DrainPolicy {
 public:
  TreeletId choose(const WaitingView& view, bool /*more_coming*/) override {
    TreeletId best = kNoIndex;
    uint32_t most = 0;
    for (TreeletId id = 0; id < view.treelet_count(); ++id) {
      const uint32_t waiting = view.waiting(id);
      if (waiting > most) most = waiting, best = id;
    }
    return best;
  }
};

}  // namespace

std::unique_ptr<DrainPolicy> make_fullest_policy() { return std::make_unique<FullestPolicy>(); }

}  // namespace shoal
