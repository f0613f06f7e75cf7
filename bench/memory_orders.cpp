#include "bench/memory_orders.h"

#include <atomic>
#include <mutex>

#include "bench/hybrid_memory_order.h"
#include "bench/ray_sort.h"
#include "engine/clock.h"

namespace shoal::bench {
namespace {

constexpr uint64_t kGroupRays = 64, kHybridGroupRays = 1024;
constexpr uint64_t kMaxBoundRays = 2048 * kGroupRays;  // a second or less
constexpr uint64_t kFetchAhead = 8;    // sorted rays lie anywhere: asked for some rays before their turn

/// Traces rays to their ends, each by itself, several under way.
class DepthFirstTracer {
 public:
  /// `more` gives the next ray, or returns false; `done` takes each ray at its end.
  template <class More, class Done>
  void trace(const MemoryScene& scene, const More& more, const Done& done) {
    Ray ray;
    bool left = true;
    const auto decide = [&](uint32_t, const GroupRay& member, TreeletId treelet) -> const std::byte* {
      if (treelet != kNoIndex) return scene.pages[treelet].data();
      counts_.node_tests += member.node_tests, counts_.triangle_tests += member.triangle_tests;
      done(member.ray);
      return nullptr;
    };
    for (;;) {
      while (left && !group_.full() && (left = more(ray))) group_.add(ray, nullptr);
      if (group_.size() == 0) return;
      counts_.treelet_visits += group_.step(scene.top_tree(), counters_, decide);
    }
  }
  const TraceCounts& counts() const { return counts_; }

 private:
  RayGroup group_;
  TraceCounters counters_;
  TraceCounts counts_;
};

/// Each ray to its end, in the order given or sorted first.
class DepthFirstOrder : public RayOrder {
 public:
  DepthFirstOrder(const MemoryScene& scene, unsigned threads, std::unique_ptr<TeamSorter> sorter)
      : scene_(scene), threads_(threads), sorter_(std::move(sorter)) {}

  OrderRun run(const RaySet& set, std::span<RayAnswer> answers) override {
    std::atomic<uint64_t> next{0};
    std::mutex mutex;
    OrderRun result;
    result.seconds = run_together(threads_, [&](unsigned thread) {
      if (sorter_ != nullptr) sorter_->sort(set.rays, thread);
      const auto tracer = std::make_unique<DepthFirstTracer>();
      for (uint64_t first; (first = next.fetch_add(kRaysPerGrab)) < set.rays.size();) {
        trace_range(set, first, std::min<uint64_t>(first + kRaysPerGrab, set.rays.size()), answers, *tracer);
      }
      const std::lock_guard guard(mutex);
      result.counts.add(tracer->counts());
    });
    return result;
  }

 private:
  void trace_range(const RaySet& set, uint64_t first, uint64_t last, std::span<RayAnswer> answers,
                   DepthFirstTracer& tracer) {
    uint64_t place = first;
    const auto more = [&](Ray& ray) {
      if (place == last) return false;
      const uint64_t index = sorter_ != nullptr ? sorter_->ray_at(place) : place;
      if (sorter_ != nullptr) __builtin_prefetch(&set.rays[sorter_->ray_at(std::min(place + kFetchAhead, last - 1))]);
      ray = begin_ray(set.rays[index], static_cast<uint32_t>(index), set.any_hit);
      ++place;
      return true;
    };
    tracer.trace(scene_, more, [&](const Ray& ray) { answers[ray.path & ~Ray::kAnyHitBit] = answer_of(ray); });
  }

  const MemoryScene& scene_;
  unsigned threads_;
  std::unique_ptr<TeamSorter> sorter_;
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
    case MemoryOrder::kHybrid: return "hybrid";
  }
  return "";
}

void trace_to_end(const MemoryScene& scene, Ray& ray) {
  const TopTree& tree = scene.top_tree();
  RayContext context;
  TraceCounters counters;
  while (!(ray.any_hit() && ray.hit.valid())) {
    const uint32_t index = tree.next(ray, context, counters.node_tests_count);
    if (index == kNoIndex) return;
    const TreeletEntry& entry = tree.entry(index);
    trace_treelet(scene.pages[entry.treelet], entry, tree.instance(ray.instance), ray, context, counters);
  }
}

std::unique_ptr<RayOrder> make_order(MemoryOrder order, const MemoryScene& scene, const OrderOptions& options,
                                     uint64_t ray_count) {
  if (order == MemoryOrder::kQueued) return make_queued_order(scene, options, ray_count);
  if (order == MemoryOrder::kHybrid) return make_hybrid_order(scene, options.threads);
  std::unique_ptr<TeamSorter> sorter;
  if (order == MemoryOrder::kSorted) {
    sorter = std::make_unique<TeamSorter>(scene.top_tree().bounds(), options.threads, ray_count);
  }
  return std::make_unique<DepthFirstOrder>(scene, options.threads, std::move(sorter));
}

/// `trace(thread, first)` traces the group that begins with that ray.
template <class Trace>
double second_pass_rays_per_second(uint64_t rays, uint64_t group_rays, unsigned threads, bool cpu_time,
                                   const Trace& trace) {
  const uint64_t group_count = rays / group_rays;
  const uint64_t sampled = std::min(group_count, kMaxBoundRays / group_rays);
  if (sampled == 0) return 0;
  std::vector<double> seconds(threads);
  run_together(threads, [&](unsigned thread) {
    const auto clock = cpu_time ? thread_cpu_seconds : now_seconds;
    const auto group = trace();
    for (uint64_t i = thread; i < sampled; i += threads) {
      const uint64_t first = i * group_count / sampled * group_rays;
      group(first);
      const double start = clock();
      group(first);
      seconds[thread] += clock() - start;
    }
  });
  return static_cast<double>(sampled * group_rays) / *std::max_element(seconds.begin(), seconds.end());
}

double bound_rays_per_second(const MemoryScene& scene, const RaySet& set, unsigned threads, bool cpu_time) {
  LargeVector<RayAnswer> answers(set.rays.size());  // kept, so that no pass is left out
  const auto single = [&] {
    return [&, tracer = std::make_shared<DepthFirstTracer>()](uint64_t first) {
      uint64_t i = first;
      const auto more = [&](Ray& ray) {
        if (i == first + kGroupRays) return false;
        ray = begin_ray(set.rays[i], static_cast<uint32_t>(i), set.any_hit);
        ++i;
        return true;
      };
      tracer->trace(scene, more, [&](const Ray& ray) { answers[ray.path & ~Ray::kAnyHitBit] = answer_of(ray); });
    };
  };
  const auto hybrid = [&] {
    return [&, tracer = std::make_shared<HybridTracer>(scene)](uint64_t first) {
      uint64_t begin = first;
      const std::function<RayRange()> grab = [&] {
        return RayRange{std::exchange(begin, first + kHybridGroupRays), first + kHybridGroupRays};
      };
      tracer->trace(set, grab, answers);
    };
  };
  const uint64_t rays = set.rays.size();
  return std::max(second_pass_rays_per_second(rays, kGroupRays, threads, cpu_time, single),
                  second_pass_rays_per_second(rays, kHybridGroupRays, threads, cpu_time, hybrid));
}

}  // namespace shoal::bench
