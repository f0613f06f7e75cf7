#include "bench/memory_orders.h"

#include <atomic>
#include <mutex>

#include "bench/ray_sort.h"
#include "engine/clock.h"
#include "treelets/trace_scene.h"

namespace shoal::bench {
namespace {

constexpr uint64_t kGroupRays = 64;
constexpr uint64_t kMaxGroups = 2048;  // of the bound: a second or less
constexpr uint64_t kFetchAhead = 8;    // sorted rays lie anywhere: asked for some rays before their turn

/// Traces rays to their ends, each by itself, several under way.
class DepthFirstTracer {
 public:
  explicit DepthFirstTracer(const MemoryScene& scene) : pages_(scene.page_table()), tracer_(scene.top_tree(), pages_.data()) {}

  /// `more` gives the next ray, or returns false; `done` takes each ray at its end.
  template <class More, class Done>
  void trace(const MemoryScene&, const More& more, const Done& done) {
    struct Stream final : RayStream {
      DepthFirstTracer& tracer;
      const More& more;
      const Done& done_ray;
      bool left = true;
      Stream(DepthFirstTracer& t, const More& m, const Done& d) : tracer(t), more(m), done_ray(d) {}
      Ray* next() override {
        if (!left || tracer.free_count_ == 0) return nullptr;
        Ray& ray = tracer.rays_[tracer.free_[tracer.free_count_ - 1]];
        if (!(left = more(ray))) return nullptr;
        --tracer.free_count_;
        return &ray;
      }
      void done(Ray& ray, const RayWork& work) override {
        tracer.counts_.node_tests += work.node_tests, tracer.counts_.triangle_tests += work.triangle_tests;
        tracer.counts_.treelet_visits += work.treelets;
        done_ray(ray);
        tracer.free_[tracer.free_count_++] = static_cast<uint32_t>(&ray - tracer.rays_);
      }
      const std::byte* bring(TreeletId) override { return nullptr; }
    };
    Stream stream(*this, more, done);
    tracer_.trace(stream, counters_);
  }
  const TraceCounts& counts() const { return counts_; }

 private:
  static constexpr uint32_t kRays = 4096;
  std::vector<const std::byte*> pages_;
  SceneTracer tracer_;
  TraceCounters counters_;
  TraceCounts counts_;
  Ray rays_[kRays];
  uint32_t free_[kRays], free_count_ = [this] { for (uint32_t i = 0; i < kRays; ++i) free_[i] = i; return kRays; }();
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
      const auto tracer = std::make_unique<DepthFirstTracer>(scene_);
      for (uint64_t first; (first = next.fetch_add(4096)) < set.rays.size();) {
        trace_range(set, first, std::min<uint64_t>(first + 4096, set.rays.size()), answers, *tracer);
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
  std::unique_ptr<TeamSorter> sorter;
  if (order == MemoryOrder::kSorted) {
    sorter = std::make_unique<TeamSorter>(scene.top_tree().bounds(), options.threads, ray_count);
  }
  return std::make_unique<DepthFirstOrder>(scene, options.threads, std::move(sorter));
}

double bound_rays_per_second(const MemoryScene& scene, const RaySet& set, unsigned threads, bool cpu_time) {
  const uint64_t group_count = set.rays.size() / kGroupRays;
  const uint64_t sampled = std::min(group_count, kMaxGroups);
  if (sampled == 0) return 0;
  std::vector<double> seconds(threads);
  run_together(threads, [&](unsigned thread) {
    const auto tracer = std::make_unique<DepthFirstTracer>(scene);
    float kept = 0;  // so that no pass is left out
    const auto trace_group = [&](uint64_t group) {
      uint64_t i = group * kGroupRays;
      const auto more = [&](Ray& ray) {
        if (i == (group + 1) * kGroupRays) return false;
        ray = begin_ray(set.rays[i], static_cast<uint32_t>(i), set.any_hit);
        ++i;
        return true;
      };
      tracer->trace(scene, more, [&](const Ray& ray) { kept += answer_of(ray).t; });
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
