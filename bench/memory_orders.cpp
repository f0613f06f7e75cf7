#include "bench/memory_orders.h"

#include <atomic>
#include <mutex>

#include "bench/ray_sort.h"
#include "engine/clock.h"

namespace shoal::bench {
namespace {

constexpr uint64_t kGroupRays = 64;
constexpr uint64_t kMaxGroups = 2048;  // of the bound: a second or less
constexpr uint64_t kFetchAhead = 8;    // sorted rays lie anywhere: asked for some rays before their turn

/// What every order's thread counts, and adds once.
struct ThreadCounts {
  TraceCounters trace;
  TraceCounts counts;

  TraceCounts sum() const {
    TraceCounts all = counts;
    all.node_tests += trace.node_tests_count, all.triangle_tests += trace.triangle_tests_count;
    return all;
  }
};

/// Each ray to its end, in the order given or sorted first.
class DepthFirstOrder : public RayOrder {
 public:
  DepthFirstOrder(const MemoryScene& scene, unsigned threads, std::unique_ptr<RaySorter> sorter)
      : scene_(scene), threads_(threads), sorter_(std::move(sorter)) {}

  OrderRun run(const RaySet& set, std::span<RayAnswer> answers) override {
    std::atomic<uint64_t> next{0};
    std::mutex mutex;
    OrderRun result;
    result.seconds = run_together(threads_, [&](unsigned thread) {
      if (sorter_ != nullptr) sorter_->sort(set.rays, thread);
      ThreadCounts counts;
      for (uint64_t first; (first = next.fetch_add(kRaysPerGrab)) < set.rays.size();) {
        trace_range(set, first, std::min<uint64_t>(first + kRaysPerGrab, set.rays.size()), answers, counts);
      }
      const std::lock_guard guard(mutex);
      result.counts.add(counts.sum());
    });
    return result;
  }

 private:
  void trace_range(const RaySet& set, uint64_t first, uint64_t last, std::span<RayAnswer> answers,
                   ThreadCounts& counts) {
    for (uint64_t place = first; place < last; ++place) {
      const uint64_t index = sorter_ != nullptr ? sorter_->ray_at(place) : place;
      if (sorter_ != nullptr) __builtin_prefetch(&set.rays[sorter_->ray_at(std::min(place + kFetchAhead, last - 1))]);
      Ray ray = begin_ray(set.rays[index], static_cast<uint32_t>(index), set.any_hit);
      trace_depth_first(scene_, ray, counts.trace, counts.counts.treelet_visits);
      answers[index] = answer_of(ray);
    }
  }

  const MemoryScene& scene_;
  unsigned threads_;
  std::unique_ptr<RaySorter> sorter_;
};

}  // namespace

void TraceCounts::add(const TraceCounts& other) {
  node_tests += other.node_tests, triangle_tests += other.triangle_tests;
  treelet_visits += other.treelet_visits, drains += other.drains;
}

const char* name_of(MemoryOrder order) {
  switch (order) {
    case MemoryOrder::kDepthFirst: return "depth-first";
    case MemoryOrder::kSorted: return "sorted";
    case MemoryOrder::kQueued: return "queued";
  }
  return "";
}

void trace_depth_first(const MemoryScene& scene, Ray& ray, TraceCounters& counters, uint64_t& treelet_visits) {
  const TopTree& tree = scene.top_tree();
  RayContext context;
  for (uint32_t index; (index = tree.next(ray, context, counters.node_tests_count)) != kNoIndex;) {
    const TreeletEntry& entry = tree.entry(index);
    trace_treelet(scene.pages[entry.treelet], entry, tree.instance(ray.instance), ray, context, counters);
    ++treelet_visits;
    if (ray.any_hit() && ray.hit.valid()) return;
  }
}

std::unique_ptr<RayOrder> make_order(MemoryOrder order, const MemoryScene& scene, const OrderOptions& options,
                                     uint64_t ray_count) {
  if (order == MemoryOrder::kQueued) return make_queued_order(scene, options, ray_count);
  std::unique_ptr<RaySorter> sorter;
  if (order == MemoryOrder::kSorted) {
    sorter = std::make_unique<RaySorter>(scene.top_tree().bounds(), options.threads, ray_count);
  }
  return std::make_unique<DepthFirstOrder>(scene, options.threads, std::move(sorter));
}

double bound_rays_per_second(const MemoryScene& scene, const RaySet& set, unsigned threads, bool cpu_time) {
  const uint64_t group_count = set.rays.size() / kGroupRays;
  const uint64_t sampled = std::min(group_count, kMaxGroups);
  if (sampled == 0) return 0;
  std::vector<double> seconds(threads);
  run_together(threads, [&](unsigned thread) {
    TraceCounters counters;
    uint64_t visits = 0;
    float kept = 0;  // so that no pass is left out
    const auto trace_group = [&](uint64_t group) {
      for (uint64_t i = group * kGroupRays; i < (group + 1) * kGroupRays; ++i) {
        Ray ray = begin_ray(set.rays[i], static_cast<uint32_t>(i), set.any_hit);
        trace_depth_first(scene, ray, counters, visits);
        kept += answer_of(ray).t;
      }
    };
    const auto clock = cpu_time ? thread_cpu_seconds : now_seconds;
    for (uint64_t i = thread; i < sampled; i += threads) {
      const uint64_t group = i * group_count / sampled;
      trace_group(group);
      const double start = clock();
      trace_group(group);
      seconds[thread] += clock() - start;
    }
    volatile float sink = kept;
    (void)sink;
  });
  return static_cast<double>(sampled * kGroupRays) / *std::max_element(seconds.begin(), seconds.end());
}

}  // namespace shoal::bench
