// resident-first: the fullest treelets that are in memory (when nothing can be read ahead, none with less than a
// minimum batch while fuller ones wait on disk); those that most wait for are read ahead, once little is left to trace
// in memory: what is loaded later is loaded for more rays. Fewest bytes read of the policies measured
// (docs/decisions/0008, 0013).
#include "queues/most_waiting.h"

namespace shoal {
namespace {

/// A batch in memory is small beside one of so many times its size. (When every batch below the minimum was, the last
/// rays had a decision for nearly every drain: a render of 25,000 treelets in memory took 62 s instead of 38.)
constexpr uint32_t kSmallShare = 4;

class ResidentFirstPolicy final : public DrainPolicy {
 public:
  explicit ResidentFirstPolicy(const PolicyOptions& options) : options_(options) {}

  void decide(std::span<const WaitingTreelet> work, bool /*more_coming*/, Decision& decision) override {
    in_memory_.clear(), on_disk_.clear();
    uint64_t rays_in_memory = 0;
    uint32_t most_in_memory = 0, most_on_disk = 0;
    for (const WaitingTreelet& w : work) {
      (w.resident ? in_memory_ : on_disk_).push_back(w);
      uint32_t& most = w.resident ? most_in_memory : most_on_disk;
      most = std::max(most, w.waiting);
      if (w.resident) rays_in_memory += w.waiting;
    }
    // With something on its way a small batch in memory is better than waiting; without, it is what a load would make
    // larger.
    const bool small_batches = options_.loads > 0 || most_in_memory >= most_on_disk;
    if (!small_batches) std::erase_if(in_memory_, [&](const auto& w) { return w.waiting < options_.minimum_batch; });
    keep_most_waiting(in_memory_, std::max(options_.drains, 1u));
    // What is small waits while something larger is there to do.
    const uint32_t least = std::min(options_.minimum_batch, most_in_memory / kSmallShare);
    while (in_memory_.size() > 1 && in_memory_.back().waiting < least) in_memory_.pop_back();
    for (const WaitingTreelet& w : in_memory_) decision.drain.push_back(w.treelet);
    load_most_wanted(decision);
    decision.rays_in_memory = rays_in_memory;
    decision.load_below_rays = options_.rays_ahead;
  }

 private:
  void load_most_wanted(Decision& decision) {
    keep_most_waiting(on_disk_, std::max(options_.loads, 1u));
    if (options_.loads > 0) {
      for (const WaitingTreelet& w : on_disk_) decision.load.push_back(w.treelet);
    } else if (decision.drain.empty() && !on_disk_.empty()) {
      decision.drain.push_back(on_disk_.front().treelet);
    }
  }

  PolicyOptions options_;
  std::vector<WaitingTreelet> in_memory_, on_disk_;
};

}  // namespace

std::unique_ptr<DrainPolicy> make_resident_first_policy(const PolicyOptions& options) {
  return std::make_unique<ResidentFirstPolicy>(options);
}

}  // namespace shoal
