// least-recent: what was used longest ago (LRU), whatever waits. The baseline, and what depth-first rendering has.
#include "io/eviction_policy.h"

namespace shoal {
namespace {

class LeastRecent final : public EvictionPolicy {
 public:
  uint64_t rank(const PageDemand& /*demand*/, uint64_t last_use) const override { return last_use; }
};

}  // namespace

std::unique_ptr<EvictionPolicy> make_least_recent_eviction() { return std::make_unique<LeastRecent>(); }

}  // namespace shoal
