// Depth-first: each path by itself from camera to end, its treelets pinned on demand (least recently used leave). The
// baseline that the queued order is compared with: same pages, same kernels, same shading. A thread has several paths
// under way, so that the kernels trace their rays together; no ray ever waits for another.
#include <chrono>
#include <thread>

#include "engine/held_pages.h"
#include "engine/render_worker.h"

namespace shoal {
namespace {

constexpr uint64_t kSamplesPerGrab = 256;
/// Of the first lattice of a preview: the other threads wait for who has the last ones.
constexpr uint64_t kFirstSamplesPerGrab = 16;
constexpr std::chrono::microseconds kFirstLatticeWait{200};
/// Paths under way in a thread, at most: twice the rays that the kernels take in turn (treelets/trace_treelets.cpp).
constexpr uint32_t kMaxPaths = 32;

class DepthFirstWorker final : public UnfinishedPaths {
 public:
  DepthFirstWorker(RenderContext& context, unsigned thread) : context_(context), worker_(context, thread) {
    path_count_ = rays_under_way(context.cache, *context.scene.file, context.threads, kMaxPaths);
  }

  void run() {
    const PauseGate::Member member(context_.gate);
    const PauseGate::Source source(context_.gate, *this);
    while (!context_.ended.load(std::memory_order_relaxed)) {
      const bool first_lattice = context_.next_sample < context_.samples.first_lattice_count();
      const SampleRange samples = context_.begin_samples(first_lattice ? kFirstSamplesPerGrab : kSamplesPerGrab);
      if (samples.first >= context_.end_sample) break;
      run_paths(samples);
      context_.samples_done += samples.size();
      worker_.report_progress();
      if (samples.size() > 0) continue;
      worker_.enter(Phase::kIdle);
      std::this_thread::sleep_for(kFirstLatticeWait);
    }
    worker_.hand_in();
  }

  void each_unfinished(const VisitUnfinished& visit) const override {
    for (const Path& path : paths_) visit_unfinished(path.state, visit);
    for (uint64_t sample = next_; sample < last_; ++sample) visit(context_.sample_at(sample));
  }

 private:
  /// A path under way. Its rays travel one after the other.
  struct Path {
    PathState state;
    Ray rays[2];
    uint32_t ray_count = 0;
    TreeletId treelet = kNoIndex;  ///< that this path, or the one before it here, was in last: what changes is counted
  };

  void run_paths(const SampleRange& samples) {
    next_ = samples.first, last_ = samples.last;
    for (uint32_t i = 0; i < path_count_ && next_ < last_; ++i) begin(i, next_++);
    const auto decide = [&](uint32_t slot, const GroupRay& member, TreeletId treelet) -> const std::byte* {
      if (treelet != kNoIndex) return pin(slot, member, treelet);
      pins_[slot].reset();
      home_[home_count_++] = slot;
      return nullptr;
    };
    while (group_.size() > 0 && !context_.ended.load(std::memory_order_relaxed)) {
      worker_.step(group_, Phase::kPaging, decide,
                   [this](const Ray& ray) { return paths_[path_index_of(ray)].state.pixel; });
      finish_rays();
      while (ready_count_ > 0) {
        const uint32_t index = ready_[--ready_count_];
        if (!go_on(index) && next_ < last_) begin(index, next_++);
      }
      worker_.safe_point();
    }
    if (group_.size() > 0) drop_rays();
  }

  void begin(uint32_t index, uint64_t sample) {
    Path& path = paths_[index];
    path.ray_count = 0;
    group_.add(worker_.begin_path(sample, index, path.state), nullptr);
  }

  /// Notes the answers of the rays that came home.
  void finish_rays() {
    worker_.enter(Phase::kPaths);
    for (uint32_t i = 0; i < home_count_; ++i) {
      const GroupRay& member = group_.ray(home_[i]);
      worker_.count_leaving(member, kNoIndex);
      const uint32_t index = path_index_of(member.ray);
      worker_.finish_ray(member.ray, paths_[index].state);
      ready_[ready_count_++] = index;
    }
    home_count_ = 0;
  }

  /// A ray of the path has come home: sends the next one out, shading first where none is left. False: the path is over.
  bool go_on(uint32_t index) {
    Path& path = paths_[index];
    if (path.ray_count == 0 && !shade(index, path)) return false;
    if (path.ray_count == 0) {
      worker_.end_path(path.state);
      return false;
    }
    group_.add(path.rays[--path.ray_count], nullptr);
    return true;
  }

  /// Returns false on an error.
  bool shade(uint32_t index, Path& path) {
    PathState& state = path.state;
    if ((state.flags & kPathGoesOn) == 0) return true;
    if (!state.hit.valid()) {
      worker_.shade_miss(state);
      return true;
    }
    const TreeletId treelet = state.hit.treelet;
    if (!worker_.hold(treelet)) return false;
    if (path.treelet != treelet) worker_.count_batch(worker_.held()), path.treelet = treelet;
    path.ray_count = worker_.shade(index, state, path.rays);
    if (path.ray_count == 2) std::swap(path.rays[0], path.rays[1]);  // the shadow ray first
    worker_.let_go();  // the cache may have room for one page a thread
    return !context_.ended.load(std::memory_order_relaxed);
  }

  /// The page of the ray's next treelet, held until the ray leaves it; none on an error.
  const std::byte* pin(uint32_t slot, const GroupRay& member, TreeletId treelet) {
    if (treelets_[slot] == treelet && pins_[slot]) return pins_[slot].bytes().data();
    if (member.traced) ++worker_.ray_counters(member.ray).ray_exits_count;
    pins_[slot].reset();
    pins_[slot] = worker_.pin(treelet);
    treelets_[slot] = treelet;
    if (!pins_[slot]) return nullptr;
    Path& path = paths_[path_index_of(member.ray)];
    worker_.charge_loads(path.state.pixel);
    if (path.treelet != treelet) worker_.count_batch(pins_[slot]), path.treelet = treelet;
    return pins_[slot].bytes().data();
  }

  void drop_rays() {
    group_.clear();
    for (PagePin& pin : pins_) pin.reset();
    ready_count_ = 0;
  }

  RenderContext& context_;
  RenderWorker worker_;
  uint32_t path_count_;
  RayGroup group_;
  PagePin pins_[RayGroup::kCapacity];  ///< by slot of the group
  TreeletId treelets_[RayGroup::kCapacity] = {};
  Path paths_[kMaxPaths];
  uint64_t next_ = 0, last_ = 0;  ///< of the samples taken, those that are not begun
  uint32_t home_[kMaxPaths];   ///< slots of the rays that came home in this step
  uint32_t home_count_ = 0;
  uint32_t ready_[kMaxPaths];  ///< their paths
  uint32_t ready_count_ = 0;
};

}  // namespace

void render_depth_first(RenderContext& context, InnerLoop loop) {
  context.inner_loop = loop;
  run_on_threads(context, [&](unsigned thread) { std::make_unique<DepthFirstWorker>(context, thread)->run(); });
  context.inner_loop = InnerLoop::kMoreNumerous;
}

}  // namespace shoal
