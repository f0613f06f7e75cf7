// Queued: rays wait beside others that want the same treelet; a policy chooses the treelet, a thread takes it in
// hand, shades the paths and traces the rays that wait there, and routes what comes out. All bounces are mixed; new
// camera samples are admitted as paths end.
#include <chrono>
#include <thread>

#include "engine/queued_paths.h"
#include "engine/render_worker.h"
#include "engine/treelet_scheduler.h"

namespace shoal {
namespace {

/// New paths are begun in batches, so that taking free ones and counting samples costs a lock a batch.
constexpr uint32_t kMaxAdmitBatch = 1024;
/// A thread with nothing to do looks again after this long, whatever the disk does.
constexpr std::chrono::microseconds kLoadWait{1000};

class QueuedWorker {
 public:
  QueuedWorker(RenderContext& context, QueuedPaths& paths, TreeletScheduler& scheduler, UsualBatches& batches)
      : context_(context),
        paths_(paths),
        scheduler_(scheduler),
        batches_(batches),
        worker_(context),
        admit_batch_(std::clamp(paths.path_count() / 8, 1u, kMaxAdmitBatch)) {}

  void run() {
    while (!context_.ended.load(std::memory_order_relaxed) && context_.samples_done < context_.samples.count()) {
      while (room_for(admit_batch_)) {
        admit(admit_batch_);
        worker_.report_progress();  // paths that see nothing end at once, and leave room for more
      }
      const TreeletId treelet = scheduler_.choose(room_for(admit_batch_), worker_.cache_counters());
      if (treelet != kNoIndex) {
        drain(treelet);
      } else if (room_for(1)) {
        admit(admit_batch_);
      } else if (context_.cache.loading_count() > 0) {
        context_.cache.wait_for_load(kLoadWait);
      } else {
        std::this_thread::yield();  // other threads have the last rays in hand
      }
      worker_.report_progress();
    }
    worker_.hand_in();
  }

 private:
  /// Whether so many new paths could begin now.
  bool room_for(uint32_t paths) const {
    return paths_.free_count() >= paths && !context_.ended.load(std::memory_order_relaxed) &&
           context_.may_begin();
  }

  /// Begins up to `wanted` new paths: addresses their camera rays and queues them.
  void admit(uint32_t wanted) {
    uint32_t path = kNoIndex;
    const uint32_t taken = paths_.take_free(wanted, &path);
    const SampleRange samples = context_.begin_samples(taken);
    for (uint32_t i = 0; i < taken; ++i) {
      const uint32_t current = path;
      path = paths_.state(current).next_free;
      if (i >= samples.size()) {
        paths_.give_back(current);
        continue;
      }
      rays_[0] = worker_.begin_path(samples.first + i, current, paths_.state(current));
      ray_count_ = 1;
      handle_rays();
    }
  }

  void drain(TreeletId treelet) {
    batches_.note(treelet, paths_.waiting(treelet));
    uint32_t path = paths_.to_shade.take(treelet);
    RayBatch batch = paths_.rays.take(treelet);
    if (!worker_.take_in_hand(treelet) || (path != kNoIndex && !worker_.pin_attributes())) return;
    while (path != kNoIndex && !context_.ended.load(std::memory_order_relaxed)) {
      const uint32_t next = paths_.to_shade.next(path);
      if (next != kNoIndex) paths_.prefetch(next);
      ray_count_ = 0;
      vertex_ready(path);
      handle_rays();
      path = next;
    }
    while (const uint32_t count = batch.next_block(block_)) {
      worker_.counters().ray_moved_bytes += count * sizeof(Ray);
      for (uint32_t i = 0; i < count && !context_.ended.load(std::memory_order_relaxed); ++i) {
        if (i + 1 < count) paths_.prefetch(path_index_of(block_.rays[i + 1]));
        ++worker_.ray_counters(block_.rays[i]).rays_drained_count;
        ray_count_ = 0;
        cross_treelets(block_.rays[i]);
        handle_rays();
      }
    }
    worker_.let_go();
  }

  /// New rays of one path: at most two, each addressed and then traced here or queued.
  void handle_rays() {
    while (ray_count_ > 0) {
      Ray ray = rays_[--ray_count_];
      worker_.begin_ray();
      route(ray, worker_.next_treelet(ray));
    }
  }

  /// The ray stands on an entry of the treelet in hand.
  void cross_treelets(Ray& ray) {
    worker_.begin_ray();
    worker_.trace(ray);
    const TreeletId next = worker_.next_treelet(ray);
    if (next != kNoIndex && next != worker_.in_hand()) ++worker_.ray_counters(ray).ray_exits_count;
    route(ray, next);
  }

  /// Sends a ray on to `treelet`, through the treelet in hand at once, or notes its answer.
  void route(Ray& ray, TreeletId treelet) {
    while (treelet != kNoIndex && treelet == worker_.in_hand()) {
      worker_.trace(ray);
      treelet = worker_.next_treelet(ray);
      if (treelet != kNoIndex && treelet != worker_.in_hand()) ++worker_.ray_counters(ray).ray_exits_count;
    }
    if (treelet != kNoIndex) {
      ++worker_.ray_counters(ray).rays_queued_count;
      worker_.counters().ray_moved_bytes += sizeof(Ray);
      paths_.rays.push(treelet, ray);
      return;
    }
    const uint32_t path = path_index_of(ray);
    if (worker_.finish_ray(ray, paths_.state(path))) vertex_ready(path);
  }

  /// Both rays of the vertex are home: the path ends, is shaded here, or waits for its treelet.
  void vertex_ready(uint32_t path_index) {
    PathState& path = paths_.state(path_index);
    if ((path.flags & kPathGoesOn) == 0) return end(path_index);
    if (!path.hit.valid()) {
      worker_.shade_miss(path);
      return end(path_index);
    }
    if (path.hit.treelet != worker_.in_hand() || !worker_.attributes_at_hand()) {
      ++worker_.counters().paths_shaded_waiting_count;
      paths_.to_shade.push(path.hit.treelet, path_index);
      return;
    }
    ray_count_ = worker_.shade(path_index, path, rays_);
    if (ray_count_ == 0) end(path_index);
  }

  void end(uint32_t path_index) {
    worker_.end_path(paths_.state(path_index));
    paths_.give_back(path_index);
    ++context_.samples_done;
  }

  RenderContext& context_;
  QueuedPaths& paths_;
  TreeletScheduler& scheduler_;
  UsualBatches& batches_;
  RenderWorker worker_;
  uint32_t admit_batch_;
  Ray rays_[2];  ///< of the path being handled
  uint32_t ray_count_ = 0;
  RayBlock block_;
};

}  // namespace

void render_queued(RenderContext& context, QueuedPaths& paths, TreeletScheduler& scheduler, UsualBatches& batches) {
  run_on_threads(context, [&] { std::make_unique<QueuedWorker>(context, paths, scheduler, batches)->run(); });
}

}  // namespace shoal
