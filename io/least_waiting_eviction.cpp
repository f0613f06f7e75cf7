// least-waiting: what fewest rays wait for. What waits is known, so nothing need be guessed from the past.
#include "io/eviction_policy.h"

namespace shoal {
namespace {

class LeastWaiting final : public EvictionPolicy {
 public:
  uint64_t rank(const PageDemand& demand, uint64_t /*last_use*/) const override { return demand.waiting; }
};

}  // namespace

std::unique_ptr<EvictionPolicy> make_least_waiting_eviction() { return std::make_unique<LeastWaiting>(); }

}  // namespace shoal
