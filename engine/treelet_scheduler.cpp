#include "engine/treelet_scheduler.h"

#include <algorithm>

#include "engine/aov_film.h"
#include "engine/clock.h"
#include "engine/render_record.h"

namespace shoal {
namespace {

/// While reads are under way a new decision would mostly repeat the last one, and looking at every treelet takes
/// milliseconds in the largest scenes: so it may take this part of the time at most. (Deciding as often as a thread had
/// nothing to do took 70 % of the time, and the disk waited for it: terrain of 1 G triangles, 64,000 treelets.)
constexpr double kDecisionShare = 0.1;
constexpr double kLeastDecisionSeconds = 0.5e-3;
/// While what usually gathers keeps out what is wanted, and less than one part in kStarvedShare of the rays that should
/// wait in memory does, it fades, to 1/e in so many seconds. Fast fading doubles the bytes that the last rays read; none
/// at all leaves the disk idle meanwhile (docs/decisions/0013).
constexpr uint32_t kStarvedShare = 8;
constexpr double kFadeSeconds = 4;
constexpr uint32_t kFadeSteps = 16;  ///< in that time

/// Reads that a decision starts at most, over those under way at once: so that the disk has work until the next one.
constexpr uint32_t kLoadsADecision = 2;
/// Larger scenes decide for longer: a decision looks at every treelet.
constexpr uint32_t kTreeletsADrain = 256;

/// Of the paths in flight, the part whose rays may wait in memory while more is read, and the least of it. Small values
/// read less and drain smaller batches, which cost more time (docs/decisions/0013).
constexpr uint32_t kPathsAheadShare = 4, kLeastRaysAhead = 16384;

}  // namespace

PolicyOptions scaled_policy(PolicyOptions options, const PagingOptions& paging, uint32_t treelets,
                            uint32_t paths_in_flight) {
  options.drains = std::max(options.drains, treelets / kTreeletsADrain);
  if (options.rays_ahead == 0) options.rays_ahead = std::max(kLeastRaysAhead, paths_in_flight / kPathsAheadShare);
  options.loads = paging.read_depth == 0 ? 0 : std::max(options.drains, kLoadsADecision * paging.read_depth);
  return options;
}

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
  const bool loading = cache_.loading_count() > 0 && (no_room_ || next_load_ < decision_.load.size());
  if (loading && now_seconds() < next_decision_seconds_) return kNoIndex;
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
    if (loads_aovs_ != nullptr) loads_aovs_->note_read_ahead(page, scene_.file->record(page).raw_bytes);
    if (record_ != nullptr) record_->read_finished(page);
    if (treelet == kNoIndex || !resident(treelet)) continue;
    decision_.drain.push_back(treelet);
    rays_in_memory_ += paths_.waiting(treelet);
  }
}

void TreeletScheduler::decide(bool more_coming) {
  const double start = now_seconds();
  const bool starved = no_room_ && decision_.rays_in_memory < decision_.load_below_rays / kStarvedShare;
  const bool fade = starved && start - faded_seconds_ > kFadeSeconds / kFadeSteps;
  if (fade) faded_seconds_ = start;
  no_room_ = false;
  work_.clear();
  for (TreeletId id = 0; id < scene_.treelets.size(); ++id) {
    const uint32_t waiting = paths_.waiting(id);
    if (fade) batches_.fade(id, kFadeSteps);
    if (waiting > 0) work_.push_back({id, waiting, resident(id)});
  }
  decision_.drain.clear(), decision_.load.clear();
  decision_.rays_in_memory = 0, decision_.load_below_rays = ~0ull;
  next_drain_ = next_load_ = 0;
  policy_.decide(work_, more_coming, decision_);
  rays_in_memory_ = decision_.rays_in_memory;
  const double end = now_seconds();
  next_decision_seconds_ = end + std::max(kLeastDecisionSeconds, (end - start) / kDecisionShare);
}

void TreeletScheduler::start_loads(CacheCounters& counters) {
  while (next_load_ < decision_.load.size() && rays_in_memory_ < decision_.load_below_rays) {
    const TreeletId treelet = decision_.load[next_load_];
    if (paths_.waiting(treelet) > 0) {
      const Prefetch answer = start_load(treelet, counters);
      if (answer == Prefetch::kBusy) return;
      if (answer == Prefetch::kNoRoom) {  // nor for the others, which are wanted less
        no_room_ = true;
        next_load_ = decision_.load.size();
        return;
      }
    }
    ++next_load_;
  }
}

Prefetch TreeletScheduler::start_load(TreeletId treelet, CacheCounters& counters) {
  const TreeletPages& pages = scene_.treelets[treelet];
  const Prefetch answer = wants_attributes(pages) ? cache_.prefetch_pair(pages.geometry, counters)
                                                  : cache_.prefetch(pages.geometry, counters);
  if (record_ != nullptr && answer == Prefetch::kStarted) record_->read_started(treelet);
  return answer;
}

}  // namespace shoal
