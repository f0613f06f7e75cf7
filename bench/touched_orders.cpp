#include "bench/touched_orders.h"

#include "bench/touched_sort.h"

namespace shoal::bench {
namespace {

constexpr uint64_t kFetchAhead = 8;  // as the sorted order does

/// Places first .. last of the order given, or of the sorted one, each ray to its end.
class TouchedDepthFirst {
 public:
  TouchedDepthFirst(const MemoryScene& scene, const RaySet& set, std::span<RayAnswer> answers, TouchMeter& meter)
      : scene_(scene), set_(set), answers_(answers), meter_(meter), group_(meter) {}

  void trace_range(uint64_t first, uint64_t last, const TouchedSort* sort) {
    uint64_t place = first;
    const auto decide = [&](const GroupRay& member, TreeletId treelet) -> const std::byte* {
      if (treelet != kNoIndex) return page_touching(scene_, treelet, meter_);
      counts_.node_tests += member.node_tests, counts_.triangle_tests += member.triangle_tests;
      answer_touching(member.ray, answers_, meter_);
      return nullptr;
    };
    for (;;) {
      for (; place < last && !group_.full(); ++place) {
        uint64_t index = place;
        if (sort != nullptr) {
          index = sort->ray_at(place, meter_);
          meter_.prefetch(&set_.rays[sort->ray_at(std::min(place + kFetchAhead, last - 1), meter_)], DataKind::kRays);
        }
        group_.add(begin_touching(set_, index, meter_), nullptr);
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
  TouchMeter& meter_;
  TouchedGroup group_;
  TraceCounters counters_;
  TraceCounts counts_;
};

}  // namespace

TraceCounts touch_order(MemoryOrder order, const MemoryScene& scene, const OrderOptions& options, const RaySet& set,
                        std::span<RayAnswer> answers, TouchMeter& meter) {
  SHOAL_CHECK(options.threads == 1);
  if (order == MemoryOrder::kQueued) return touch_queued_order(scene, options, set, answers, meter);
  std::unique_ptr<TouchedSort> sort;
  if (order == MemoryOrder::kSorted) {
    sort = std::make_unique<TouchedSort>(scene.top_tree().bounds(), set.rays, meter);
  }
  const auto tracer = std::make_unique<TouchedDepthFirst>(scene, set, answers, meter);
  for (uint64_t first = 0; first < set.rays.size(); first += kRaysPerGrab) {
    tracer->trace_range(first, std::min<uint64_t>(first + kRaysPerGrab, set.rays.size()), sort.get());
  }
  return tracer->counts();
}

}  // namespace shoal::bench
