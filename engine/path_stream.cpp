#include "engine/path_stream.h"

#include <chrono>
#include <thread>

#include "engine/render_worker.h"
#include "engine/streamed_paths.h"

namespace shoal {
namespace {

/// Sleep between looks while other threads complete the first lattice of a preview.
constexpr std::chrono::microseconds kFirstLatticeWait{200};

class PathStream final : public RayStream, public UnfinishedPaths {
 public:
  PathStream(RenderContext& context, unsigned thread, Order order, const MakeTraversal& make)
      : context_(context),
        worker_(context, thread),
        paths_(context.scene.treelets.size(), StreamedPaths::paths_of(order)),
        samples_per_grab_(paths_.capacity / 4),
        traversal_(make(context.scene.top_tree, paths_.pages.data(), context.picture.shading.triangle_test,
                        worker_.touches())) {}

  void run() {
    const PauseGate::Member member(context_.gate);
    const PauseGate::Source source(context_.gate, *this);
    worker_.enter(Phase::kTraversal);
    traversal_->trace(*this, worker_.trace_counters());
    for (PagePin& pin : paths_.pins) pin.reset();
    worker_.hand_in();
  }

  void each_unfinished(const VisitUnfinished& visit) const override {
    for (uint32_t path = 0; path < paths_.capacity; ++path) visit_unfinished(paths_.states[path], visit);
  }

  Ray* next() override {
    if (paths_.next_ready == paths_.ready.size() && !make_rays()) return nullptr;
    return &paths_.rays[paths_.ready[paths_.next_ready++]];
  }

  void done(Ray& ray, const RayWork& work) override {
    RayCounters& rays = worker_.ray_counters(ray);
    rays.node_tests_count += work.node_tests;
    rays.triangle_tests_count += work.triangle_tests;
    if (work.treelets > 1) rays.ray_exits_count += work.treelets - 1;
    worker_.counters().treelet_visits_count += work.treelets;
    if (worker_.counts_treelets()) {
      worker_.count_treelets(paths_.states[(&ray - paths_.rays.data()) / 2].pixel, work.treelets);
    }
    paths_.home.push_back(static_cast<uint32_t>(&ray - paths_.rays.data()));
  }

  const std::byte* bring(TreeletId treelet) override {
    if (context_.ended.load(std::memory_order_relaxed)) return nullptr;
    worker_.enter(Phase::kPaging);
    paths_.pins[treelet] = worker_.pin(treelet);
    if (paths_.pins[treelet]) paths_.pages[treelet] = paths_.pins[treelet].bytes().data();
    worker_.enter(Phase::kTraversal);
    return paths_.pages[treelet];
  }

 private:
  /// The next rays of what came home, and of new paths; false when there are none: for now, or, with none under
  /// way, for good.
  bool make_rays() {
    paths_.ready.clear();
    paths_.next_ready = 0;
    while (!context_.ended.load(std::memory_order_relaxed)) {
      take_home();
      while (paths_.free.size() >= samples_per_grab_ && begin_paths()) {
      }
      worker_.report_progress();
      const bool waits = paths_.ready.empty() && paths_.free.size() == paths_.capacity &&
                         context_.next_sample.load(std::memory_order_relaxed) < context_.end_sample;
      if (!waits) break;
      worker_.enter(Phase::kIdle);
      std::this_thread::sleep_for(kFirstLatticeWait);
    }
    worker_.enter(Phase::kTraversal);
    return !paths_.ready.empty();
  }

  void take_home() {
    worker_.enter(Phase::kPaths);
    if (worker_.charges_loads()) share_loads();
    uint32_t kept = 0;
    for (const uint32_t index : paths_.home) {  // first those whose vertex is complete, for one run through shading
      const Ray& ray = paths_.rays[index];
      if (worker_.finish_ray(ray, paths_.states[index / 2])) paths_.home[kept++] = index / 2;
    }
    paths_.home.resize(kept);
    for (const uint32_t path : paths_.home) {
      if (context_.ended.load(std::memory_order_relaxed)) break;
      shade_vertex(path);
    }
    worker_.let_go();
    paths_.home.clear();
  }

  /// Pages were read for the packets that met them: the rays that came home since the last time.
  void share_loads() {
    if (paths_.home.empty()) return;
    RenderWorker::SharedLoad load = worker_.load_for(paths_.home.size());
    for (const uint32_t index : paths_.home) worker_.charge_share(paths_.states[index / 2].pixel, load);
  }

  /// Shades the path's vertex, if it has one; without a ray to follow the path is over.
  void shade_vertex(uint32_t path) {
    PathState& state = paths_.states[path];
    Ray rays[2];
    uint32_t count = 0;
    if ((state.flags & kPathGoesOn) != 0) {
      if (!state.hit.valid()) {
        worker_.shade_miss(state);
      } else if (worker_.take_in_hand(state.hit.treelet)) {
        count = worker_.shade(path, state, rays);
      }
    }
    if (context_.ended.load(std::memory_order_relaxed)) return;
    for (uint32_t i = 0; i < count; ++i) {
      const uint32_t index = 2 * path + (rays[i].any_hit() ? 1 : 0);
      paths_.rays[index] = rays[i];
      worker_.touch_waiting(&paths_.rays[index], TouchAction::kWrite);
      paths_.ready.push_back(index);
    }
    if (count > 0) return;
    worker_.end_path(state);
    ++context_.samples_done;
    paths_.free.push_back(path);
  }

  bool begin_paths() {
    const SampleRange samples = context_.begin_samples(samples_per_grab_);
    for (uint64_t sample = samples.first; sample < samples.last; ++sample) {
      const uint32_t path = paths_.free.back();
      paths_.free.pop_back();
      paths_.rays[2 * path] = worker_.begin_path(sample, path, paths_.states[path]);
      worker_.touch_waiting(&paths_.rays[2 * path], TouchAction::kWrite);
      paths_.ready.push_back(2 * path);
    }
    return samples.size() > 0;
  }

  RenderContext& context_;
  RenderWorker worker_;
  StreamedPaths paths_;
  /// A quarter of the paths, so that packets fill; few enough that threads end at about the same time.
  const uint64_t samples_per_grab_;
  const std::unique_ptr<SceneTraversal> traversal_;
};

}  // namespace

void render_streamed(RenderContext& context, Order order, const MakeTraversal& make) {
  run_on_threads(context,
                 [&](unsigned thread) { std::make_unique<PathStream>(context, thread, order, make)->run(); });
}

}  // namespace shoal
