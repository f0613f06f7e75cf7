// What a rendering thread does to a path in any order: beginning it, finishing its rays, shading its vertices, ending
// it. The orders (render_depth_first, render_sorted, render_queued) decide only when and where. One worker a thread.
#pragma once

#include <atomic>
#include <mutex>

#include "engine/camera.h"
#include "engine/film.h"
#include "engine/pass_plan.h"
#include "engine/path_ray.h"
#include "engine/pause_gate.h"
#include "engine/phase_clock.h"
#include "engine/ray_group.h"
#include "engine/render.h"
#include "engine/sample_order.h"
#include "engine/thread_record.h"
#include "io/page_cache.h"
#include "treelets/touch_log.h"
#include "treelets/trace_treelet.h"

namespace shoal {

class AdaptiveSampling;
class AovFilm;
class Checkpoints;
class Preview;
class RayList;

/// Samples begun together.
struct SampleRange {
  uint64_t first = 0, last = 0;  ///< indices of SampleOrder; `last` is not among them
  uint64_t size() const { return last - first; }
};

/// Everything the threads of one render share.
struct RenderContext {
  const Scene& scene;
  const PictureOptions& picture;
  const ShadingTables& tables;
  const Camera& camera;
  const SampleOrder& samples;  ///< of this pass (engine/pass_plan.h): another between two passes
  const Sampler& sampler;
  const RenderHooks& hooks;
  PageCache& cache;
  Film& film;
  unsigned threads;
  Preview* preview = nullptr;  ///< or none
  AovFilm* aovs = nullptr;     ///< or none
  AdaptiveSampling* adaptive = nullptr;  ///< or none: every sample counts
  RayList* list = nullptr;  ///< or none; else sample i is its ray i, and there is no camera, no shading and no film
  InnerLoop inner_loop = InnerLoop::kMoreNumerous;  ///< of step(); set while no order runs, as the next
  uint32_t packet_rays = 64;                        ///< ExecutionOptions
  Checkpoints* checkpoints = nullptr;    ///< or none
  PauseGate gate{};                      ///< of the threads, for checkpoints
  TouchRecorder* touches = nullptr;      ///< or none: nobody measures
  RenderRecord* record = nullptr;        ///< or none

  /// Samples that begin until the order ends: all of the pass, but for trials (engine/order_runner.h). Set while no
  /// order runs.
  uint64_t end_sample = 0;
  uint64_t samples_before = 0;  ///< of earlier passes; those below count the pass's own
  Forecast forecast{};
  std::atomic<uint64_t> next_sample{0};
  std::atomic<uint64_t> samples_done{0};
  std::atomic<uint64_t> disk_read_bytes{0};
  std::atomic<bool> ended{false};  ///< an error or a stop: threads return soon
  std::mutex mutex{};              ///< guards error and counters
  Status error{};
  RenderCounters counters{};
  double start_seconds = 0;
  double seconds_before = 0;  ///< of the renders that this one goes on from
  /// Of a pass that was interrupted: what was begun and not finished then begins again first. The samples with indices
  /// from `again_first` on are these.
  std::vector<UnfinishedSample> again{};
  uint64_t again_first = 0;
  uint64_t samples_restored = 0;  ///< of all_samples_done(), those that an earlier render did
  std::vector<PhaseClock> phases{};  ///< one a thread, since the render began

  void fail(Error error);
  /// Takes up to `wanted` samples that nobody has begun; none are left, for now or for good, when it is empty.
  SampleRange begin_samples(uint64_t wanted);
  /// What the index of begin_samples() stands for.
  UnfinishedSample sample_at(uint64_t index) const {
    if (index - again_first < again.size()) return again[index - again_first];
    const PixelSample sample = samples.at(index);
    return {sample.y * picture.width + sample.x, sample.sample, kSeeksSurface};
  }
  /// To be called when all threads have ended a pass: the next counts from 0.
  void end_pass();
  uint64_t all_samples_done() const { return samples_before + samples_done; }
  bool may_begin() const { return next_sample.load(std::memory_order_relaxed) < begin_limit(); }

 private:
  /// With a preview nothing else begins before the first lattice is complete. Else policies would drain the large
  /// queues of later samples first, and the lattice's few rays would wait.
  uint64_t begin_limit() const {
    const uint64_t lattice = samples.first_lattice_count();
    return samples_done >= lattice ? end_sample : std::min(end_sample, lattice);
  }
};

class QueuedPaths;
class SortedPaths;
class TreeletScheduler;
class UsualBatches;

class RenderWorker {
 public:
  /// Of the thread with this index.
  RenderWorker(RenderContext& context, unsigned thread);

  /// What this thread does from now on. The functions below that take long enter their phase themselves.
  void enter(Phase phase) { phases_.enter(phase); }

  /// To be called where no path is half dealt with (engine/pause_gate.h), and often.
  void safe_point() {
    if (context_.gate.paused()) context_.gate.wait();
  }

  /// Begins sample `index` in `path`; returns its camera ray, or the ray of the list.
  Ray begin_path(uint64_t index, uint32_t path_index, PathState& path);

  /// Every ray of `group` goes on by one treelet; see RayGroup. `sending`: the phase of what `decide` does.
  /// `pixel_of(ray)`: for cost maps.
  template <class Decide, class PixelOf>
  void step(RayGroup& group, Phase sending, const Decide& decide, const PixelOf& pixel_of) {
    enter(Phase::kTopTree);
    group.address(context_.scene.top_tree, touches_);
    enter(sending);
    group.send(context_.scene.top_tree, decide);
    enter(Phase::kTraversal);
    if (visits_aovs_ != nullptr) {
      group.each([&](const Ray& ray) { count_treelets(pixel_of(ray), 1); });
    }
    if (record_ != nullptr) {
      group.each([&](const Ray& ray) { record_->note_visit(context_.scene.top_tree.current(ray).treelet); });
    }
    counters_.treelet_visits_count += group.trace(context_.scene.top_tree, trace_counters_,
                                                         context_.picture.shading.triangle_test, context_.inner_loop,
                                                         touches_);
  }
  /// A ray of a group leaves it, for `next` or, with kNoIndex, because its answer is known: counts what it did there.
  void count_leaving(const GroupRay& member, TreeletId next);

  /// The ray's answer is known: notes it in its path. Returns true when it was the last ray of the vertex.
  bool finish_ray(const Ray& ray, PathState& path);

  /// Shades path.hit, which is in the treelet in hand. Writes the vertex's rays to `rays` and returns how many (0..2).
  /// Sets path.pending and kPathGoesOn. After 0 the path is over.
  uint32_t shade(uint32_t path_index, PathState& path, Ray rays[2]);
  /// The camera or bounce ray left the scene.
  void shade_miss(PathState& path);
  /// Whether a sample is part of the picture, or only helps to decide where to draw more.
  bool counts(uint32_t pixel, uint32_t sample) const;
  /// Adds the path to the film.
  void end_path(PathState& path);

  /// Cost maps. Treelets that a ray of the pixel entered:
  bool counts_treelets() const { return visits_aovs_ != nullptr; }
  void count_treelets(uint32_t pixel, uint64_t count);
  /// Pages that this thread has read since the last charge were read for a ray of this pixel.
  void charge_loads(uint32_t pixel) {
    if (loads_aovs_ != nullptr && uncharged_bytes() > 0) charge_loads_to(pixel);
  }
  bool charges_loads() const { return loads_aovs_ != nullptr; }
  /// Pages that were read for several rays.
  struct SharedLoad {
    uint64_t bytes = 0, sharers = 0;
  };
  /// What this thread has read since the last charge. Requires: charges_loads().
  SharedLoad load_for(uint64_t sharers);
  /// The same, and what was read ahead of the treelet in hand.
  SharedLoad load_in_hand(uint64_t sharers);
  /// Takes one of the equal shares from the load. Requires: sharers > 0.
  void charge_share(uint32_t pixel, SharedLoad& load);

  /// The page of a treelet, for one ray or a batch. Nothing on an error (context.ended is set).
  PagePin pin(TreeletId treelet);
  /// A batch, or a ray, has changed to this treelet: its bytes are taken in hand.
  void count_batch(const PagePin& geometry);
  /// Pins the treelet; the one before is let go. Returns false on an error (context.ended is set).
  bool hold(TreeletId treelet);
  const PagePin& held() const { return geometry_; }
  /// The same, unless it is in hand already, and counts it as a batch.
  bool take_in_hand(TreeletId treelet);
  TreeletId in_hand() const { return in_hand_; }
  /// The page of the treelet in hand; none when there is no such treelet.
  const std::byte* page_in_hand() const { return geometry_.bytes().data(); }
  void let_go();
  /// Pins the attributes of the treelet in hand. Returns false on an error (context.ended is set).
  bool pin_attributes();
  /// Whether shading in the treelet in hand would read nothing from disk.
  bool attributes_at_hand() const;

  RayCounters& ray_counters(const Ray& ray) {
    return counters_.rays[static_cast<size_t>(kind_of(ray))][counted_bounce_of(ray)];
  }
  RenderCounters& counters() { return counters_; }
  TraceCounters& trace_counters() { return trace_counters_; }
  CacheCounters& cache_counters() { return cache_counters_; }
  /// Told what this thread touches; none: nobody measures.
  TouchLog* touches() { return touches_; }
  /// A ray is copied to, or from, where it waits.
  void touch_waiting(const Ray* ray, TouchAction action) {
    if (touches_ != nullptr) [[unlikely]] touches_->add(ray, sizeof(Ray), TouchKind::kQueues, action);
  }
  /// Shows the preview, writes the checkpoint and calls the progress hook now and then, unless another thread is at it; sees
  /// stop requests. A safe point.
  void report_progress();
  /// Adds this worker's counters to the context. Called once, at the end.
  void hand_in();

 private:
  Ray begin_listed(uint64_t index, uint32_t path_index, PathState& path);
  /// Only where somebody records: `rays` are those of a vertex.
  void record(const ShadeResult& result, const PathState& path, const Ray* rays) const;
  /// The vertex `bounce`, which was shaded, is what the path sought, or is looked through when it `goes_on`.
  void note_features(PathState& path, uint32_t bounce, bool goes_on);
  void end_features(const PathState& path, const Vec3& radiance);
  /// What a record is told (engine/render_worker_record.cpp); with none nothing.
  void record_progress(bool due_only);
  void record_begin_hand(TreeletId treelet);
  void record_end_hand();
  /// After a page was pinned before which the counters were these.
  void record_pin(TreeletId treelet, bool geometry, uint64_t decoded_before, uint64_t waited_before);
  uint64_t uncharged_bytes() const { return cache_counters_.decoded_bytes - charged_bytes_; }
  void charge_loads_to(uint32_t pixel);
  /// The path's state is read and written.
  void move_state(const PathState& path) {
    counters_.path_state_moved_bytes += sizeof(PathState);
    if (touches_ != nullptr) [[unlikely]] touches_->write(&path, sizeof(PathState), TouchKind::kPathStates);
  }

  RenderContext& context_;
  const unsigned thread_;
  PhaseClock& phases_;
  Shader shader_;
  uint32_t camera_cone_;  ///< PathState::cone of a path that begins
  const RaySeeds seeds_;
  PagePin geometry_, attributes_;
  TreeletId in_hand_ = kNoIndex;
  TreeletId attributes_of_ = kNoIndex;
  RenderCounters counters_;
  CacheCounters cache_counters_;
  TraceCounters trace_counters_;
  ShadeCounters shade_counters_;
  InvalidSamples invalid_;  ///< of what the shader did not see
  TouchLog* touches_ = nullptr;
  AovFilm *aovs_ = nullptr, *visits_aovs_ = nullptr, *loads_aovs_ = nullptr;  ///< where such AOVs are asked for
  ThreadRecord* record_ = nullptr;  ///< or none
  LiveCounts recorded_;             ///< what it was told so far
  bool seeks_ = false;          ///< paths begin with PathState::seeks
  uint64_t charged_bytes_ = 0;  ///< of cache_counters_.decoded_bytes
  uint64_t disk_bytes_reported_ = 0;
  double next_report_seconds_ = 0;
};

/// What a cache counted joins the counters of the render.
void add_cache_counters(const CacheCounters& cache, RenderCounters& counters);

/// The orders. Each returns when every sample is in the film or context.ended is set.
void render_depth_first(RenderContext& context, InnerLoop loop = InnerLoop::kMoreNumerous);
void render_sorted(RenderContext& context, SortedPaths& paths);
/// Requires: a cache with room for every page, as the next three.
void render_hybrid(RenderContext& context);
void render_packet(RenderContext& context);
void render_packet_reorder(RenderContext& context);
void render_stream(RenderContext& context);
void render_queued(RenderContext& context, QueuedPaths& paths, TreeletScheduler& scheduler, UsualBatches& batches);

/// Runs `work(thread index)` on the threads of a render (engine/run_on_threads). Memory that runs out in one of them ends
/// it for all: they would wait for its rays or samples for ever.
void run_on_threads(RenderContext& context, const std::function<void(unsigned)>& work);

}  // namespace shoal
