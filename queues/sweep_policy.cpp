// sweep: round and round in storage order, every treelet with work in its turn.
#include "queues/most_waiting.h"

namespace shoal {
namespace {

class SweepPolicy final : public DrainPolicy {
 public:
  explicit SweepPolicy(const PolicyOptions& options) : options_(options) {}

  void decide(std::span<const WaitingTreelet> work, bool /*more_coming*/, Decision& decision) override {
    const auto after = std::partition_point(work.begin(), work.end(),
                                            [&](const WaitingTreelet& w) { return w.treelet < next_; });
    const auto first = static_cast<size_t>(after - work.begin());
    const size_t count = std::min<size_t>(work.size(), std::max(options_.drains, 1u));
    turn_.clear();
    for (size_t i = 0; i < count; ++i) turn_.push_back(work[(first + i) % work.size()]);
    for (const WaitingTreelet& w : turn_) decision.drain.push_back(w.treelet);
    if (!turn_.empty()) next_ = turn_.back().treelet + 1;
    load_what_is_drained(turn_, options_.loads, decision);
  }

 private:
  PolicyOptions options_;
  TreeletId next_ = 0;
  std::vector<WaitingTreelet> turn_;
};

}  // namespace

std::unique_ptr<DrainPolicy> make_sweep_policy(const PolicyOptions& options) {
  return std::make_unique<SweepPolicy>(options);
}

}  // namespace shoal
