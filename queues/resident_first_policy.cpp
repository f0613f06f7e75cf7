// resident-first: the fullest treelet that is in memory, unless what waits there is less than a minimum batch while a
// treelet on disk has more; then the one that most wait for is loaded. Fewest bytes read of
// the policies measured in a prototype (docs/decisions/0008).
#include <algorithm>

#include "queues/drain_policy.h"

namespace shoal {
namespace {

class ResidentFirstPolicy final : public DrainPolicy {
 public:
  explicit ResidentFirstPolicy(uint32_t minimum_batch) : minimum_batch_(std::max(minimum_batch, 1u)) {}

  TreeletId choose(const WaitingView& view, bool /*more_coming*/) override {
    TreeletId in_memory = kNoIndex, anywhere = kNoIndex;
    uint32_t most_in_memory = 0, most = 0;
    for (TreeletId id = 0; id < view.treelet_count(); ++id) {
      const uint32_t waiting = view.waiting(id);
      if (waiting > most) most = waiting, anywhere = id;
      if (waiting > most_in_memory && view.resident(id)) most_in_memory = waiting, in_memory = id;
    }
    return most_in_memory >= minimum_batch_ ? in_memory : anywhere;
  }

 private:
  uint32_t minimum_batch_;
};

}  // namespace

std::unique_ptr<DrainPolicy> make_resident_first_policy(uint32_t minimum_batch) {
  return std::make_unique<ResidentFirstPolicy>(minimum_batch);
}

}  // namespace shoal
