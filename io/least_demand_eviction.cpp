// least-demand: what fewest rays wait for or are likely to ask for soon. A treelet that was just drained has nothing
// waiting, yet one in the middle of the scene fills again at once: what gathered there before stands for that.
#include "io/eviction_policy.h"

namespace shoal {
namespace {

class LeastDemand final : public EvictionPolicy {
 public:
  uint64_t rank(const PageDemand& demand, uint64_t /*last_use*/) const override {
    return worth(demand);
  }
  uint64_t worth(const PageDemand& demand) const override { return demand.waiting + demand.usual; }
};

}  // namespace

std::unique_ptr<EvictionPolicy> make_least_demand_eviction() { return std::make_unique<LeastDemand>(); }

}  // namespace shoal
