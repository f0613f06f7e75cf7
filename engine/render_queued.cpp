// Queued: rays wait beside others that want the same treelet; a policy chooses the treelet, a thread takes it in
// hand, shades the paths and traces the rays that wait there, and routes what comes out. All bounces are mixed; new
// camera samples are admitted as paths end.
#include <chrono>
#include <thread>

#include "engine/queued_paths.h"
#include "engine/render_worker.h"
#include "engine/treelet_scheduler.h"
#include "queues/ray_outbox.h"

namespace shoal {
namespace {

/// New paths are begun in batches, so that taking free ones and counting samples costs a lock a batch.
constexpr uint32_t kMaxAdmitBatch = 1024;
/// And so are ended ones given back.
constexpr uint32_t kEndedBatch = 64;
/// A thread with nothing to do looks again after this long, whatever the disk does.
constexpr std::chrono::microseconds kLoadWait{1000};

class QueuedWorker final : public UnfinishedPaths {
 public:
  QueuedWorker(RenderContext& context, unsigned thread, QueuedPaths& paths, TreeletScheduler& scheduler,
               UsualBatches& batches)
      : context_(context),
        paths_(paths),
        scheduler_(scheduler),
        batches_(batches),
        worker_(context, thread),
        admit_batch_(std::clamp(paths.path_count() / 8, 1u, kMaxAdmitBatch)),
        outbox_(paths.rays, worker_.touches()),
        ended_(paths) {}

  void run() {
    const PauseGate::Member member(context_.gate);
    const PauseGate::Source source(context_.gate, *this);
    while (!context_.ended.load(std::memory_order_relaxed) && context_.samples_done < context_.end_sample) {
      while (room_for(admit_batch_)) {
        admit(admit_batch_);
        worker_.report_progress();  // paths that see nothing end at once, and leave room for more
      }
      worker_.enter(Phase::kScheduling);
      const TreeletId treelet = scheduler_.choose(room_for(admit_batch_), worker_.cache_counters());
      if (treelet != kNoIndex) {
        drain(treelet);
      } else if (room_for(1)) {
        admit(admit_batch_);
      } else if (context_.cache.loading_count() > 0) {
        worker_.enter(Phase::kPaging);
        context_.cache.wait_for_load(kLoadWait);
      } else {
        worker_.enter(Phase::kIdle);
        std::this_thread::yield();  // other threads have the last rays in hand
      }
      worker_.report_progress();
    }
    worker_.hand_in();
  }

  void each_unfinished(const VisitUnfinished& visit) const override {
    for (uint64_t sample = taken_.first; sample < taken_.last; ++sample) visit(context_.sample_at(sample));
  }

 private:
  /// Whether so many new paths could begin now.
  bool room_for(uint32_t paths) const {
    return paths_.free_count() >= paths && !context_.ended.load(std::memory_order_relaxed) &&
           context_.may_begin();
  }

  /// Begins up to `wanted` new paths: addresses their camera rays and queues them.
  void admit(uint32_t wanted) {
    worker_.enter(Phase::kPaths);
    uint32_t path = kNoIndex;
    const uint32_t taken = paths_.take_free(wanted, &path);
    taken_ = context_.begin_samples(taken);
    uint32_t i = 0;
    travel([&] {
      if (taken_.size() == 0) return false;
      const uint32_t current = path;
      path = paths_.state(current).next;
      fresh(worker_.begin_path(taken_.first++, current, paths_.state(current)));
      ++i;
      return true;
    });
    for (; i < taken; ++i) {
      const uint32_t current = path;
      path = paths_.state(current).next;
      paths_.give_back(current);
    }
  }

  void drain(TreeletId treelet) {
    worker_.enter(Phase::kQueue);
    batches_.note(treelet, paths_.waiting(treelet));
    uint32_t path = paths_.to_shade.take(treelet);
    RayBatch batch = paths_.rays.take(treelet);
    if (!worker_.take_in_hand(treelet) || (path != kNoIndex && !worker_.pin_attributes())) return;
    if (worker_.charges_loads()) share_load(path, batch);
    uint32_t next = 0, count = 0;
    travel([&] {
      if (path != kNoIndex) {
        const uint32_t current = path;
        path = paths_.state(current).next;
        if (path != kNoIndex) paths_.prefetch(path);
        vertex_ready(current);
        return true;
      }
      worker_.enter(Phase::kQueue);
      if (next == count) {
        if (worker_.touches() != nullptr) [[unlikely]] touch_block(batch.next_rays());
        next = 0, count = batch.next_block(block_);
        if (count == 0) return false;
        worker_.counters().ray_moved_bytes += count * sizeof(Ray);
      }
      const Ray& ray = block_.rays[next++];
      worker_.touch_waiting(&ray, TouchAction::kRead);
      ++worker_.ray_counters(ray).rays_drained_count;
      group_.add(ray, worker_.page_in_hand());
      return true;
    });
    worker_.let_go();
  }

  /// Rays are copied from their block to this thread's.
  void touch_block(std::span<const Ray> rays) {
    if (rays.empty()) return;
    worker_.touches()->read(rays.data(), rays.size_bytes(), TouchKind::kQueues);
    worker_.touches()->write(block_.rays, rays.size_bytes(), TouchKind::kQueues);
  }

  /// For the cost map: pages that were read for the treelet in hand are shared by all that waited for it.
  void share_load(uint32_t first_path, const RayBatch& batch) {
    uint64_t sharers = 0;
    for (uint32_t path = first_path; path != kNoIndex; path = paths_.state(path).next) ++sharers;
    batch.each([&](const Ray&) { ++sharers; });
    if (sharers == 0) return;
    RenderWorker::SharedLoad load = worker_.load_in_hand(sharers);
    for (uint32_t path = first_path; path != kNoIndex; path = paths_.state(path).next) {
      worker_.charge_share(paths_.state(path).pixel, load);
    }
    batch.each([&](const Ray& ray) { worker_.charge_share(paths_.state(path_index_of(ray)).pixel, load); });
  }

  /// A ray that has no cursor yet.
  void fresh(const Ray& ray) { fresh_[fresh_count_++] = ray; }

  /// Keeps the group full of rays and moves it on until there are no more. `more` puts rays into the group, or fresh
  /// ones aside; it returns false when it has none left.
  template <class More>
  void travel(const More& more) {
    const auto decide = [this](uint32_t slot, const GroupRay& member, TreeletId treelet) {
      return route(slot, member, treelet);
    };
    bool left = true;
    while (!context_.ended.load(std::memory_order_relaxed)) {
      while (!group_.full() && !context_.ended.load(std::memory_order_relaxed)) {
        if (fresh_count_ > 0) {
          worker_.enter(Phase::kPaths);
          group_.add(fresh_[--fresh_count_], nullptr);
        } else if (!left || !(left = more())) {
          break;
        }
      }
      if (group_.size() == 0) break;
      worker_.step(group_, Phase::kQueue, decide,
                   [this](const Ray& ray) { return paths_.state(path_index_of(ray)).pixel; });
      finish_rays();
      worker_.safe_point();
    }
    if (context_.ended.load(std::memory_order_relaxed)) {
      outbox_.clear();
    } else {
      worker_.enter(Phase::kQueue);
      outbox_.flush();
    }
    give_back_ended();
    group_.clear(), fresh_count_ = 0;
  }

  /// Sends a ray on to `treelet`: through the treelet in hand at once, into a queue, or home.
  const std::byte* route(uint32_t slot, const GroupRay& member, TreeletId treelet) {
    if (treelet == kNoIndex) {
      paths_.prefetch(path_index_of(member.ray));
      home_[home_count_++] = slot;
      return nullptr;
    }
    if (treelet == worker_.in_hand()) return worker_.page_in_hand();
    const Ray& ray = member.ray;
    worker_.count_leaving(member, treelet);
    ++worker_.ray_counters(ray).rays_queued_count;
    worker_.counters().ray_moved_bytes += sizeof(Ray);
    outbox_.push(treelet, ray);
    return nullptr;
  }

  /// Notes the answers of the rays that came home, then handles the vertices that have no other ray out.
  void finish_rays() {
    worker_.enter(Phase::kPaths);
    uint32_t ready[RayGroup::kCapacity];
    uint32_t ready_count = 0;
    for (uint32_t i = 0; i < home_count_; ++i) {
      const GroupRay& member = group_.ray(home_[i]);
      worker_.count_leaving(member, kNoIndex);
      const uint32_t path = path_index_of(member.ray);
      if (worker_.finish_ray(member.ray, paths_.state(path))) ready[ready_count++] = path;
    }
    home_count_ = 0;
    for (uint32_t i = 0; i < ready_count; ++i) vertex_ready(ready[i]);
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
      worker_.enter(Phase::kQueue);
      ++worker_.counters().paths_shaded_waiting_count;
      paths_.to_shade.push(path.hit.treelet, path_index, path.next);
      return;
    }
    Ray rays[2];
    const uint32_t count = worker_.shade(path_index, path, rays);
    for (uint32_t i = 0; i < count; ++i) fresh(rays[i]);
    if (count == 0) end(path_index);
  }

  void end(uint32_t path_index) {
    worker_.end_path(paths_.state(path_index));
    ended_.add(path_index);
    if (ended_.count() == kEndedBatch) give_back_ended();
  }

  void give_back_ended() {
    context_.samples_done += ended_.count();
    ended_.give_back();
  }

  RenderContext& context_;
  QueuedPaths& paths_;
  TreeletScheduler& scheduler_;
  UsualBatches& batches_;
  RenderWorker worker_;
  uint32_t admit_batch_;
  SampleRange taken_;  ///< samples that this thread is beginning
  RayGroup group_;
  uint32_t home_[RayGroup::kCapacity];  ///< slots of the rays that came home in this step
  uint32_t home_count_ = 0;
  /// Waiting to join the group. While there are any, nothing else joins it: so they belong to the at most 64 paths that
  /// had a ray in the group, each of which has at most two.
  Ray fresh_[2 * RayGroup::kCapacity];
  uint32_t fresh_count_ = 0;
  RayBlock block_;
  RayOutbox outbox_;
  EndedPaths ended_;
};

}  // namespace

void render_queued(RenderContext& context, QueuedPaths& paths, TreeletScheduler& scheduler, UsualBatches& batches) {
  const PauseGate::Source source(context.gate, paths);
  run_on_threads(context, [&](unsigned thread) {
    std::make_unique<QueuedWorker>(context, thread, paths, scheduler, batches)->run();
  });
}

}  // namespace shoal
