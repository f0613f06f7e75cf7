// Sorted: waves. All rays of the paths under way are sorted by where they begin and where they go, then each is
// traced to its end in that order, its treelets pinned on demand (least recently used leave), so that rays that
// follow each other want the same pages and find them in the processor's caches. A vertex is shaded as soon as both
// its rays are home, while the triangle that was hit is close; its new rays wait for the next wave. Paths that end
// make room for new samples, so waves stay full. Between waves all threads wait for the last one.
#include <algorithm>

#include "engine/held_pages.h"
#include "engine/render_worker.h"
#include "engine/sorted_paths.h"

namespace shoal {
namespace {

/// Rays that a thread takes at once. Fewer of a small wave, so that threads end together.
constexpr uint64_t kRaysPerGrab = 1024;
/// Rays lie anywhere: asked for so many before their turn.
constexpr uint64_t kFetchAhead = 16;
constexpr uint64_t kSamplesPerGrab = 256;

class SortedWorker {
 public:
  SortedWorker(RenderContext& context, unsigned thread, SortedPaths& paths, std::atomic<uint64_t>& next_place)
      : context_(context), paths_(paths), next_place_(next_place), worker_(context, thread),
        group_limit_(rays_under_way(context.cache, *context.scene.file, context.threads, RayGroup::kCapacity)),
        held_(group_limit_) {}

  /// Begins new samples in the paths [first, last) that are free: their camera rays join the next wave.
  void begin_paths(uint32_t first, uint32_t last) {
    worker_.enter(Phase::kPaths);
    uint32_t free = 0;
    for (uint32_t path = first; path < last; ++path) free += paths_.free(path) ? 1 : 0;
    SampleRange samples;
    for (uint32_t path = first; free > 0; ++path) {
      if (!paths_.free(path)) continue;
      if (samples.size() == 0) samples = context_.begin_samples(std::min<uint64_t>(free, kSamplesPerGrab));
      if (samples.size() == 0) return;
      std::construct_at(&paths_.state(path));
      put(worker_.begin_path(samples.first++, path, paths_.state(path)));
      --free;
    }
  }

  /// Traces its share of the wave's `count` rays, and shades.
  void trace(uint64_t count) {
    const PauseGate::Member pausing(context_.gate);
    grab_ = std::clamp<uint64_t>(count / (8 * context_.threads), 1, kRaysPerGrab);
    count_ = count;
    place_ = last_ = 0;
    const auto decide = [this](uint32_t slot, const GroupRay& member, TreeletId treelet) -> const std::byte* {
      if (treelet != kNoIndex) return hold(slot, member, treelet);
      held_.release(slot);
      home_[home_count_++] = slot;
      return nullptr;
    };
    while (!context_.ended.load(std::memory_order_relaxed)) {
      while (group_.size() < group_limit_ && add_next()) {
      }
      if (group_.size() == 0) break;
      worker_.step(group_, Phase::kPaging, decide, [this](const Ray& ray) { return pixel_of(ray); });
      finish_rays();
      for (uint32_t i = 0; i < ready_count_; ++i) vertex_ready(ready_[i]);
      ready_count_ = 0;
      if (group_limit_ == 1) worker_.let_go();  // the cache may have room for one page a thread
      worker_.safe_point();
    }
    worker_.let_go();
    group_.clear();
    held_.clear();
    ready_count_ = 0;
    worker_.report_progress();
  }

  void hand_in() { worker_.hand_in(); }
  TouchLog* touches() { return worker_.touches(); }

 private:
  void put(const Ray& ray) {
    worker_.enter(Phase::kQueue);
    worker_.counters().ray_moved_bytes += sizeof(Ray);
    paths_.put(ray, worker_.touches());
  }

  /// The next ray of the wave joins the group; false: there is none.
  bool add_next() {
    if (place_ == last_) {
      place_ = next_place_.fetch_add(grab_);
      last_ = std::min(place_ + grab_, count_);
      if (place_ >= last_) {
        place_ = last_ = 0;
        return false;
      }
      worker_.report_progress();
    }
    worker_.enter(Phase::kQueue);
    if (place_ + kFetchAhead < count_) paths_.prefetch(place_ + kFetchAhead);
    worker_.counters().ray_moved_bytes += sizeof(Ray);
    const Ray& ray = paths_.ray_at(place_++, worker_.touches());
    worker_.touch_waiting(&ray, TouchAction::kRead);
    group_.add(ray, nullptr);
    return true;
  }

  uint32_t pixel_of(const Ray& ray) { return paths_.state(path_index_of(ray)).pixel; }

  /// The page of the ray's next treelet, held until the ray leaves it; none on an error.
  const std::byte* hold(uint32_t slot, const GroupRay& member, TreeletId treelet) {
    if (const std::byte* page = held_.page(slot, treelet)) return page;
    if (member.traced) ++worker_.ray_counters(member.ray).ray_exits_count;
    return held_.hold(slot, treelet, [&] {
      PagePin pin = worker_.pin(treelet);
      if (pin) worker_.count_batch(pin);
      worker_.charge_loads(pixel_of(member.ray));
      return pin;
    });
  }

  /// Notes the answers of the rays that came home.
  void finish_rays() {
    worker_.enter(Phase::kPaths);
    for (uint32_t i = 0; i < home_count_; ++i) {
      const GroupRay& member = group_.ray(home_[i]);
      worker_.count_leaving(member, kNoIndex);
      const uint32_t path = path_index_of(member.ray);
      if (worker_.finish_ray(member.ray, paths_.state(path))) ready_[ready_count_++] = path;
    }
    home_count_ = 0;
  }

  /// Both rays of the vertex are home: the path ends, or is shaded, and its new rays join the next wave.
  void vertex_ready(uint32_t path_index) {
    PathState& path = paths_.state(path_index);
    uint32_t count = 0;
    if ((path.flags & kPathGoesOn) != 0) {
      if (path.hit.valid()) {
        if (!worker_.take_in_hand(path.hit.treelet)) return;
        Ray rays[2];
        count = worker_.shade(path_index, path, rays);
        for (uint32_t i = 0; i < count; ++i) put(rays[i]);
      } else {
        worker_.shade_miss(path);
      }
    }
    if (count > 0 || context_.ended.load(std::memory_order_relaxed)) return;
    worker_.end_path(path);
    ++context_.samples_done;
  }

  RenderContext& context_;
  SortedPaths& paths_;
  std::atomic<uint64_t>& next_place_;
  RenderWorker worker_;
  uint32_t group_limit_;
  HeldPages held_;
  RayGroup group_;
  uint32_t home_[RayGroup::kCapacity];   ///< slots of the rays that came home in this step
  uint32_t home_count_ = 0;
  uint32_t ready_[RayGroup::kCapacity];  ///< paths whose last ray did
  uint32_t ready_count_ = 0;
  uint64_t place_ = 0, last_ = 0;  ///< of the wave: what is left of this thread's grab
  uint64_t count_ = 0, grab_ = 0;
};

}  // namespace

void render_sorted(RenderContext& context, SortedPaths& paths) {
  const PauseGate::Source source(context.gate, paths);
  const unsigned threads = context.threads;
  std::atomic<uint64_t> next_place{0};
  std::vector<std::unique_ptr<SortedWorker>> workers;
  for (unsigned t = 0; t < threads; ++t) {
    workers.push_back(std::make_unique<SortedWorker>(context, t, paths, next_place));
  }
  const auto together = [&](const std::function<void(unsigned)>& step) { run_on_threads(context, step); };
  const auto sort = [&](const std::function<void(unsigned, TouchLog*)>& step) {
    together([&](unsigned t) {
      context.phases[t].enter(Phase::kQueue);
      step(t, workers[t]->touches());
    });
  };
  const uint64_t path_count = paths.path_count();
  RaySorter& sorter = paths.sorter;
  while (!context.ended) {
    together([&](unsigned t) {
      workers[t]->begin_paths(static_cast<uint32_t>(path_count * t / threads),
                              static_cast<uint32_t>(path_count * (t + 1) / threads));
    });
    for (uint32_t pass = 0; pass < RaySorter::kPasses; ++pass) {
      sort([&](unsigned t, TouchLog* touches) { sorter.count(pass, t, touches); });
      sort([&](unsigned t, TouchLog* touches) { sorter.scatter(pass, t, touches); });
    }
    if (sorter.size() == 0) break;
    sort([&](unsigned t, TouchLog* touches) { sorter.clear(t, touches); });
    next_place = 0;
    together([&](unsigned t) { workers[t]->trace(sorter.size()); });
  }
  for (const auto& worker : workers) worker->hand_in();
}

}  // namespace shoal
