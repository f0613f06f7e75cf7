#include "engine/treelet_scheduler.h"

#include "engine/render_worker.h"

namespace shoal {
namespace {

/// While reads are under way a new decision would mostly repeat the last one; looking at every treelet costs up to a
/// millisecond in the largest scenes.
constexpr double kDecisionSeconds = 0.5e-3;

}  // namespace

std::vector<TreeletId> treelet_of_pages(const Scene& scene) {
  std::vector<TreeletId> treelets(scene.file->page_count(), kNoIndex);
  for (TreeletId id = 0; id < scene.treelets.size(); ++id) {
    treelets[scene.treelets[id].geometry] = id;
    if (scene.treelets[id].attributes != kNoPage) treelets[scene.treelets[id].attributes] = id;
  }
  return treelets;
}

TreeletId TreeletScheduler::choose(bool more_coming, CacheCounters& counters) {
  const std::lock_guard guard(mutex_);
  start_loads(counters);
  TreeletId treelet = take_ready();
  if (treelet != kNoIndex) return treelet;
  const bool loading = cache_.loading_count() > 0;
  if (loading && now_seconds() - decided_seconds_ < kDecisionSeconds) return kNoIndex;
  decide(more_coming);
  start_loads(counters);
  treelet = take_ready();
  if (treelet != kNoIndex || decision_.load.empty() || cache_.loading_count() > 0) return treelet;
  return decision_.load.front();
}

TreeletId TreeletScheduler::take_ready() {
  if (next_drain_ == decision_.drain.size()) take_loaded();
  while (next_drain_ < decision_.drain.size()) {
    const TreeletId treelet = decision_.drain[next_drain_++];
    const uint32_t waiting = paths_.waiting(treelet);
    rays_in_memory_ -= std::min<uint64_t>(waiting, rays_in_memory_);
    if (waiting > 0) return treelet;
    if (next_drain_ == decision_.drain.size()) take_loaded();
  }
  return kNoIndex;
}

/// What has come from the disk since is ready, as soon as all of its pages are there.
void TreeletScheduler::take_loaded() {
  cache_.take_loaded(loaded_);
  for (const PageId page : loaded_) {
    const TreeletId treelet = page_treelets_[page];
    if (treelet == kNoIndex || !resident(treelet)) continue;
    decision_.drain.push_back(treelet);
    rays_in_memory_ += paths_.waiting(treelet);
  }
}

void TreeletScheduler::decide(bool more_coming) {
  work_.clear();
  for (TreeletId id = 0; id < scene_.treelets.size(); ++id) {
    const uint32_t waiting = paths_.waiting(id);
    if (waiting > 0) work_.push_back({id, waiting, resident(id)});
  }
  decision_.drain.clear(), decision_.load.clear();
  decision_.rays_in_memory = 0, decision_.load_below_rays = ~0ull;
  next_drain_ = next_load_ = 0;
  policy_.decide(work_, more_coming, decision_);
  rays_in_memory_ = decision_.rays_in_memory;
  decided_seconds_ = now_seconds();
}

void TreeletScheduler::start_loads(CacheCounters& counters) {
  while (next_load_ < decision_.load.size() && rays_in_memory_ < decision_.load_below_rays) {
    const TreeletId treelet = decision_.load[next_load_];
    if (paths_.waiting(treelet) > 0) {
      const Prefetch answer = start_load(treelet, counters);
      if (answer == Prefetch::kBusy) return;
      if (answer == Prefetch::kNoRoom) next_load_ = decision_.load.size() - 1;  // the others are wanted less
    }
    ++next_load_;
  }
}

Prefetch TreeletScheduler::start_load(TreeletId treelet, CacheCounters& counters) {
  const TreeletPages& pages = scene_.treelets[treelet];
  return pages.attributes == kNoPage ? cache_.prefetch(pages.geometry, counters)
                                     : cache_.prefetch_pair(pages.geometry, counters);
}

}  // namespace shoal
