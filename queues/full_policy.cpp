// full: a queue is flushed when its capacity is reached; what is left in partly filled queues when no new rays can
// come is flushed fullest first.
#include "queues/most_waiting.h"

namespace shoal {
namespace {

class FullPolicy final : public DrainPolicy {
 public:
  explicit FullPolicy(const PolicyOptions& options) : options_(options) {}

  void decide(std::span<const WaitingTreelet> work, bool more_coming, Decision& decision) override {
    flushed_.clear();
    const size_t limit = std::max(options_.drains, 1u);
    for (const WaitingTreelet& w : work) {
      if (w.waiting >= options_.queue_capacity && flushed_.size() < limit) flushed_.push_back(w);
    }
    if (flushed_.empty() && !more_coming) {
      flushed_.assign(work.begin(), work.end());
      keep_most_waiting(flushed_, 1);
    }
    for (const WaitingTreelet& w : flushed_) decision.drain.push_back(w.treelet);
    load_what_is_drained(flushed_, options_.loads, decision);
  }

 private:
  PolicyOptions options_;
  std::vector<WaitingTreelet> flushed_;
};

}  // namespace

std::unique_ptr<DrainPolicy> make_full_policy(const PolicyOptions& options) {
  return std::make_unique<FullPolicy>(options);
}

}  // namespace shoal
