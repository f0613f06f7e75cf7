// fullest: the treelets that most rays and paths wait for, in memory or not; ties go to the smaller id.
#include "queues/most_waiting.h"

namespace shoal {
namespace {

class FullestPolicy final : public DrainPolicy {
 public:
  explicit FullestPolicy(const PolicyOptions& options) : options_(options) {}

  void decide(std::span<const WaitingTreelet> work, bool /*more_coming*/, Decision& decision) override {
    most_.assign(work.begin(), work.end());
    keep_most_waiting(most_, std::max(options_.drains, 1u));
    for (const WaitingTreelet& w : most_) decision.drain.push_back(w.treelet);
    load_what_is_drained(most_, options_.loads, decision);
  }

 private:
  PolicyOptions options_;
  std::vector<WaitingTreelet> most_;
};

}  // namespace

std::unique_ptr<DrainPolicy> make_fullest_policy(const PolicyOptions& options) {
  return std::make_unique<FullestPolicy>(options);
}

}  // namespace shoal
