// sweep: round and round in storage order, every treelet with work in its turn.
#include "queues/drain_policy.h"

namespace shoal {
namespace {

class SweepPolicy final : public DrainPolicy {
 public:
  TreeletId choose(const WaitingView& view, bool /*more_coming*/) override {
    const uint32_t count = view.treelet_count();
    for (uint32_t step = 0; step < count; ++step) {
      position_ = position_ + 1 < count ? position_ + 1 : 0;
      if (view.waiting(position_) > 0) return position_;
    }
    return kNoIndex;
  }

 private:
  uint32_t position_ = kNoIndex - 1;
};

}  // namespace

std::unique_ptr<DrainPolicy> make_sweep_policy() { return std::make_unique<SweepPolicy>(); }

}  // namespace shoal
