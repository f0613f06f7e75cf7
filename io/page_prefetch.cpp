// Reads ahead: what a scheduler wants next comes while the tracing threads go on.
#include "io/page_cache_state.h"

namespace shoal {

/// Requires the lock.
std::byte* PageCache::State::begin_prefetch(PageId page, CacheCounters& counters, Prefetch& answer) {
  answer = Prefetch::kNotNeeded;
  if ((slots[page].state.load() & kResident) != 0 || loads.contains(page)) return nullptr;
  std::byte* data = try_make_room(page_bytes(page), work_of(page), counters);
  answer = data == nullptr ? Prefetch::kNoRoom : Prefetch::kStarted;
  if (data != nullptr) loads.emplace(page, std::make_shared<PageLoad>());
  return data;
}

/// Requires the lock. Another thread took the last place among the reads meanwhile.
void PageCache::State::abandon_prefetch(PageId page, std::byte* data) {
  const std::shared_ptr<PageLoad> load = loads.at(page);
  load->abandoned = load->done = true;
  loads.erase(page);
  used_bytes -= PageBuffers::charge_bytes(page_bytes(page));
  buffers.keep(data, page_bytes(page));
  loaded.notify_all();
  unpinned.notify_all();
}

Prefetch PageCache::prefetch(PageId page, CacheCounters& counters) {
  State& s = *state_;
  SHOAL_CHECK(page < s.file.page_count());
  if (resident(page)) return Prefetch::kNotNeeded;
  if (s.loader == nullptr || s.loader->full()) return Prefetch::kBusy;
  Prefetch answer;
  std::byte* data = nullptr;
  {
    const std::lock_guard lock(s.mutex);
    data = s.begin_prefetch(page, counters, answer);
  }
  if (data == nullptr || s.loader->try_start(page, data)) return answer;
  const std::lock_guard lock(s.mutex);
  s.abandon_prefetch(page, data);
  return Prefetch::kBusy;
}

Prefetch PageCache::prefetch_pair(PageId page, CacheCounters& counters) {
  State& s = *state_;
  SHOAL_CHECK(page + 1 < s.file.page_count());
  const StoredRange first = s.file.stored_range(page), next = s.file.stored_range(page + 1);
  if (resident(page) || resident(page + 1) || first.offset + first.bytes != next.offset) {
    const Prefetch answer = prefetch(page, counters);
    if (answer == Prefetch::kBusy || answer == Prefetch::kNoRoom) return answer;
    return prefetch(page + 1, counters);
  }
  if (s.loader == nullptr || s.loader->full()) return Prefetch::kBusy;
  Prefetch answer, next_answer = Prefetch::kNotNeeded;
  std::byte *data = nullptr, *next_data = nullptr;
  {
    const std::lock_guard lock(s.mutex);
    data = s.begin_prefetch(page, counters, answer);
    if (data != nullptr) next_data = s.begin_prefetch(page + 1, counters, next_answer);
  }
  if (data == nullptr || s.loader->try_start(page, data, next_data)) return answer;
  const std::lock_guard lock(s.mutex);
  s.abandon_prefetch(page, data);
  if (next_data != nullptr) s.abandon_prefetch(page + 1, next_data);
  return Prefetch::kBusy;
}

/// A loader thread brings a page, or an error.
void PageCache::State::finish_prefetch(PageId page, std::byte* data, Status status,
                                       PageLoader::ReadShare share) {
  CacheCounters counters;
  counters.page_prefetches_count = 1;
  counters.disk_reads_count = share.reads;
  counters.disk_read_bytes = share.bytes;
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

const char* PageCache::read_backend() const { return state_->loader == nullptr ? "none" : state_->loader->backend(); }

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
