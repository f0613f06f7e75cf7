#include <fmt/core.h>

#include <algorithm>

#include "io/page_cache_state.h"

namespace shoal {

/// Charges the page before its memory is taken. The kept buffer that the page will take over costs nothing new.
Result<std::byte*> PageCache::State::make_room(uint32_t bytes, std::unique_lock<std::mutex>& lock,
                                               CacheCounters& counters) {
  const uint64_t charge = PageBuffers::charge_bytes(bytes);
  if (charge > capacity_bytes) {
    return Error{ErrorCode::kMemoryCap, fmt::format("a page of {} does not fit the page cache: expected at most {} "
                                                    "bytes, found {}",
                                                    file.path(), capacity_bytes, charge)};
  }
  for (;;) {
    const uint64_t spare = buffers.kept_bytes() - buffers.reusable_bytes(bytes);
    if (used_bytes + spare + charge <= capacity_bytes) break;
    if (spare > 0) {
      buffers.release_other(bytes);
    } else if (!evict_one(counters)) {
      wait_for_room(lock, counters);
    }
  }
  Result<std::byte*> buffer = buffers.take(bytes);
  if (buffer.ok()) used_bytes += charge;
  account();
  return buffer;
}

void PageCache::State::account() {
  const uint64_t held = used_bytes + buffers.kept_bytes();
  SHOAL_CHECK(held <= capacity_bytes);
  held_bytes.store(held, std::memory_order_relaxed);
  peak_bytes.store(std::max(peak_bytes.load(std::memory_order_relaxed), held), std::memory_order_relaxed);
}

/// Everything is pinned or being read. Looks once more after announcing itself, so that no unpin is missed.
void PageCache::State::wait_for_room(std::unique_lock<std::mutex>& lock, CacheCounters& counters) {
  room_waiters.fetch_add(1);
  if (!evict_one(counters)) unpinned.wait(lock);
  room_waiters.fetch_sub(1);
}

uint64_t PageCache::State::rank_of(PageId page) const {
  return eviction->rank(waiting ? waiting(page) : PageDemand(), slots[page].last_use.load(std::memory_order_relaxed));
}

uint64_t PageCache::State::worth_of(PageId page) const {
  return eviction->worth(waiting ? waiting(page) : PageDemand());
}

std::byte* PageCache::State::try_make_room(uint32_t bytes, uint64_t work, CacheCounters& counters) {
  const uint64_t charge = PageBuffers::charge_bytes(bytes);
  if (charge > capacity_bytes) return nullptr;
  for (;;) {
    const uint64_t spare = buffers.kept_bytes() - buffers.reusable_bytes(bytes);
    if (used_bytes + spare + charge <= capacity_bytes) break;
    if (spare > 0) {
      buffers.release_other(bytes);
    } else if (!evict_one(counters, work)) {
      return nullptr;
    }
  }
  Result<std::byte*> buffer = buffers.take(bytes);
  if (!buffer.ok()) return nullptr;
  used_bytes += charge;
  account();
  return buffer.value();
}

/// Evicts the lowest page, if it is worth less than `below_work`. False when it saw every page pinned or too busy; the
/// pages it had chosen may have been pinned under its eyes.
bool PageCache::State::evict_one(CacheCounters& counters, uint64_t below_work) {
  while (!order.empty()) {
    const PageId page = order.next().page;
    const bool stale = rank_of(page) > order.highest_rank();
    if (!stale && below_work != ~0ull && worth_of(page) >= below_work) break;
    order.take();
    if (!stale && try_evict(page, counters)) return true;
  }
  if (!order.empty()) return false;
  rank_candidates();
  while (!order.empty()) {
    if (below_work != ~0ull && worth_of(order.next().page) >= below_work) return false;
    if (try_evict(order.take().page, counters)) return true;
  }
  return false;
}

void PageCache::State::rank_candidates() {
  auto& candidates = order.start();
  for (const PageId page : residents) {
    if (slots[page].state.load() != kResident) continue;
    candidates.push_back({rank_of(page), slots[page].last_use.load(std::memory_order_relaxed), page});
  }
  order.rank();
}

bool PageCache::State::try_evict(PageId page, CacheCounters& counters) {
  PageSlot& slot = slots[page];
  uint32_t expected = kResident;
  if (!slot.state.compare_exchange_strong(expected, 0)) return false;
  residents[slot.place] = residents.back();
  slots[residents.back()].place = slot.place;
  residents.pop_back();
  const uint32_t bytes = page_bytes(page);
  used_bytes -= PageBuffers::charge_bytes(bytes);
  buffers.keep(slot.data, bytes);
  slot.data = nullptr;
  counters.page_evictions_count += 1;
  return true;
}

}  // namespace shoal
