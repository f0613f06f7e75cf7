// Reads ahead: what a scheduler wants next comes while the tracing threads go on.
#include "io/page_cache_state.h"

namespace shoal {

Prefetch PageCache::prefetch(PageId page, CacheCounters& counters) {
  State& s = *state_;
  SHOAL_CHECK(page < s.file.page_count());
  if (resident(page)) return Prefetch::kNotNeeded;
  if (s.loader == nullptr || s.loader->full()) return Prefetch::kBusy;
  std::byte* data = nullptr;
  {
    const std::lock_guard lock(s.mutex);
    if ((s.slots[page].state.load() & kResident) != 0 || s.loads.contains(page)) return Prefetch::kNotNeeded;
    data = s.try_make_room(s.page_bytes(page), s.work_of(page), counters);
    if (data == nullptr) return Prefetch::kNoRoom;
    s.loads.emplace(page, std::make_shared<PageLoad>());
  }
  if (s.loader->try_start(page, data)) return Prefetch::kStarted;
  // Another thread took the last place meanwhile.
  const std::lock_guard lock(s.mutex);
  const std::shared_ptr<PageLoad> load = s.loads.at(page);
  load->error = Error{ErrorCode::kInternal, "not read after all"};
  load->abandoned = load->done = true;
  s.loads.erase(page);
  s.used_bytes -= PageBuffers::charge_bytes(s.page_bytes(page));
  s.buffers.keep(data, s.page_bytes(page));
  s.loaded.notify_all();
  s.unpinned.notify_all();
  return Prefetch::kBusy;
}

/// A loader thread brings a page, or an error.
void PageCache::State::finish_prefetch(PageId page, std::byte* data, Status status) {
  CacheCounters counters;
  counters.page_prefetches_count = 1;
  counters.disk_reads_count = 1;
  counters.disk_read_bytes = file.stored_range(page).bytes;
  if (status.ok()) status = check_read(page, data, counters);
  background_bytes.fetch_add(counters.disk_read_bytes, std::memory_order_relaxed);
  {
    const std::lock_guard lock(mutex);
    const auto under_way = loads.find(page);
    const std::shared_ptr<PageLoad> load = under_way->second;
    loads.erase(under_way);
    load->done = true;
    if (status.ok()) {
      publish(page, data, load->waiting_threads);
      prefetched.push_back(page);
    } else {
      load->error = status.error();
      if (!first_failure) first_failure = status.error();
      failed.store(true, std::memory_order_release);
      used_bytes -= PageBuffers::charge_bytes(page_bytes(page));
      buffers.keep(data, page_bytes(page));
    }
    background.add(counters);
  }
  loaded.notify_all();
  unpinned.notify_all();  // a page without a pin may be evicted
}

void PageCache::take_loaded(std::vector<PageId>& pages) {
  pages.clear();
  const std::lock_guard lock(state_->mutex);
  std::swap(pages, state_->prefetched);
}

unsigned PageCache::loading_count() const { return state_->loader == nullptr ? 0 : state_->loader->under_way(); }

void PageCache::wait_for_load(std::chrono::microseconds at_most) {
  State& s = *state_;
  if (loading_count() == 0) return;
  std::unique_lock lock(s.mutex);
  s.loaded.wait_for(lock, at_most, [&] { return !s.prefetched.empty() || s.failed.load(); });
}

void PageCache::finish_loads() {
  if (state_->loader != nullptr) state_->loader->finish();
}

Status PageCache::failure() const {
  State& s = *state_;
  if (!s.failed.load(std::memory_order_acquire)) return {};
  const std::lock_guard lock(s.mutex);
  return *s.first_failure;
}

CacheCounters PageCache::background_counters() const {
  const std::lock_guard lock(state_->mutex);
  return state_->background;
}

uint64_t PageCache::background_read_bytes() const { return state_->background_bytes.load(std::memory_order_relaxed); }

}  // namespace shoal
