// Which treelet a thread takes in hand next, and what is read from disk meanwhile: serves the decisions of a drain
// policy one by one, keeps the disk busy with what they want, and hands out treelets as they arrive.
// Called by engine/render_queued.
//
// Properties and assumptions
//   threads    any number; one lock a choice. A decision looks at every treelet and is good for many choices.
//   progress   when nothing is resident, nothing on its way and no room can be made, the most wanted treelet is given
//              out all the same: who takes it in hand reads it, and that always finds room (io/page_cache.h).
//   staleness  a treelet of a decision may have been drained or evicted since: it is skipped, or read again.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include "engine/queued_paths.h"
#include "engine/scene.h"
#include "io/page_cache.h"
#include "queues/drain_policy.h"

namespace shoal {

class AovFilm;
class RenderRecord;

/// Fits the lengths of decisions to the size of the scene and to the paths in flight.
PolicyOptions scaled_policy(PolicyOptions options, const PagingOptions& paging, uint32_t treelets,
                            uint32_t paths_in_flight);

/// For every page the treelet it belongs to, kNoIndex for texture tiles and tables.
std::vector<TreeletId> treelet_of_pages(const Scene& scene);

/// What usually waits for a treelet when it is drained: the mean of the drains, the last ones weighing most; fades while
/// it is not drained, so that what gathered long ago does not keep out what is wanted now.
class UsualBatches {
 public:
  explicit UsualBatches(size_t treelets) : batches_(treelets) {}
  uint32_t of(TreeletId treelet) const { return batches_[treelet].load(std::memory_order_relaxed); }
  void note(TreeletId treelet, uint32_t drained) {
    batches_[treelet].store((of(treelet) + drained) / 2, std::memory_order_relaxed);
  }
  /// Takes one part in `divisor`, rounded up, from it.
  void fade(TreeletId treelet, uint32_t divisor) {
    const uint32_t usual = of(treelet);
    if (usual > 0) batches_[treelet].store(usual - (usual + divisor - 1) / divisor, std::memory_order_relaxed);
  }

 private:
  std::vector<std::atomic<uint32_t>> batches_;
};

class TreeletScheduler {
 public:
  /// `shades`: attributes are wanted beside the geometry.
  TreeletScheduler(const Scene& scene, const QueuedPaths& paths, PageCache& cache, DrainPolicy& policy,
                   UsualBatches& batches, std::span<const TreeletId> page_treelets, AovFilm* loads_aovs = nullptr,
                   bool shades = true, RenderRecord* record = nullptr)
      : scene_(scene),
        paths_(paths),
        cache_(cache),
        policy_(policy),
        batches_(batches),
        page_treelets_(page_treelets),
        loads_aovs_(loads_aovs),
        shades_(shades),
        record_(record) {}

  /// The treelet to drain next, or kNoIndex: nothing is worth it yet, or what is wanted is still on its way.
  TreeletId choose(bool more_coming, CacheCounters& counters);

  /// Everything is there that is wanted of it: draining it reads nothing.
  bool resident(TreeletId treelet) const {
    const TreeletPages& pages = scene_.treelets[treelet];
    return cache_.resident(pages.geometry) && (!wants_attributes(pages) || cache_.resident(pages.attributes));
  }

 private:
  bool wants_attributes(const TreeletPages& pages) const { return shades_ && pages.attributes != kNoPage; }
  TreeletId take_ready();
  void take_loaded();
  void decide(bool more_coming);
  void start_loads(CacheCounters& counters);
  Prefetch start_load(TreeletId treelet, CacheCounters& counters);

  const Scene& scene_;
  const QueuedPaths& paths_;
  PageCache& cache_;
  DrainPolicy& policy_;
  UsualBatches& batches_;
  std::span<const TreeletId> page_treelets_;
  AovFilm* loads_aovs_;  ///< where loads are charged to pixels, else none
  bool shades_;
  RenderRecord* record_;  ///< or none

  std::mutex mutex_;
  Decision decision_;
  size_t next_drain_ = 0, next_load_ = 0;
  bool no_room_ = false;         ///< for what the decision wanted: what is resident is worth more
  uint64_t rays_in_memory_ = 0;  ///< left of those that the decision saw
  double faded_seconds_ = 0;
  double next_decision_seconds_ = 0;  ///< while reads are under way, not before
  std::vector<WaitingTreelet> work_;
  std::vector<PageId> loaded_;
};

}  // namespace shoal
