#include "bench/touched_orders.h"

#include "bench/touched_sort.h"

namespace shoal::bench {
namespace {

constexpr uint64_t kFetchAhead = 8;  // as the sorted order does

/// Places first .. last of the order given, or of the sorted one, each ray to its end.
class TouchedDepthFirst {
 public:
  TouchedDepthFirst(const MemoryScene& scene, const RaySet& set, std::span<RayAnswer> answers, TouchLog& log)
      : scene_(scene), set_(set), answers_(answers), log_(log), group_(log) {}

  void trace_range(uint64_t first, uint64_t last, const TouchedSort* sort) {
    uint64_t place = first;
    const auto decide = [&](const GroupRay& member, TreeletId treelet) -> const std::byte* {
      if (treelet != kNoIndex) return page_touching(scene_, treelet, log_);
      counts_.node_tests += member.node_tests, counts_.triangle_tests += member.triangle_tests;
      answer_touching(member.ray, answers_, log_);
      return nullptr;
    };
    for (;;) {
      for (; place < last && !group_.full(); ++place) {
        uint64_t index = place;
        if (sort != nullptr) {
          index = sort->ray_at(place, log_);
          log_.prefetch(&set_.rays[sort->ray_at(std::min(place + kFetchAhead, last - 1), log_)], TouchKind::kGivenRays);
        }
        group_.add(begin_touching(set_, index, log_), nullptr);
      }
      if (group_.size() == 0) return;
      counts_.treelet_visits += group_.step(scene_.top_tree(), counters_, decide);
    }
  }
  const TraceCounts& counts() const { return counts_; }

 private:
  const MemoryScene& scene_;
  const RaySet& set_;
  std::span<RayAnswer> answers_;
  TouchLog& log_;
  TouchedGroup group_;
  TraceCounters counters_;
  TraceCounts counts_;
};

}  // namespace

TraceCounts touch_order(MemoryOrder order, const MemoryScene& scene, const OrderOptions& options, const RaySet& set,
                        std::span<RayAnswer> answers, TouchLog& log) {
  SHOAL_CHECK(options.threads == 1);
  if (order == MemoryOrder::kQueued) return touch_queued_order(scene, options, set, answers, log);
  std::unique_ptr<TouchedSort> sort;
  if (order == MemoryOrder::kSorted) {
    sort = std::make_unique<TouchedSort>(scene.top_tree().bounds(), set.rays, log);
  }
  const auto tracer = std::make_unique<TouchedDepthFirst>(scene, set, answers, log);
  for (uint64_t first = 0; first < set.rays.size(); first += kRaysPerGrab) {
    tracer->trace_range(first, std::min<uint64_t>(first + kRaysPerGrab, set.rays.size()), sort.get());
  }
  return tracer->counts();
}

}  // namespace shoal::bench
