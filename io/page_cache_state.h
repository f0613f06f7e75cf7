// The inside of the page cache: slots, reads under way and the lock. Included by page_cache.cpp (pins and loads),
// page_prefetch.cpp (reads ahead) and page_cache_eviction.cpp (room for the next page). Thread rule: as the comments say. Cost: 24 bytes a page of
// the file.
#pragma once

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <unordered_map>
#include <vector>

#include "io/eviction_order.h"
#include "io/page_buffers.h"
#include "io/page_cache.h"

namespace shoal {

/// A page's place in the cache. `state` is kResident plus the number of pins; a page that is not resident may show
/// a pin for an instant, of a thread that came too late and is taking its pin back.
///
///   absent (0) --publish, under the lock--> resident and pinned <--pin, unpin--> resident (kResident)
///   resident (kResident) --evict, under the lock, by compare and swap--> absent
///
/// `data` and `place` change under the lock only, and `data` only while the page is absent.
struct alignas(32) PageSlot {
  std::atomic<uint32_t> state{0};
  uint32_t bytes = 0;                 // decoded size, so that a hit touches this line only
  std::atomic<uint64_t> last_use{0};  // State::tick: even for a load, odd for a hit after it
  std::byte* data = nullptr;
  uint32_t place = 0;  // in State::residents
  std::atomic<bool> checked{false};  // the page passed PageCheck before
};
static_assert(sizeof(PageSlot) == 32);
inline constexpr uint32_t kResident = 1u << 31;

/// A read under way. Threads that want the same page wait for it, and the loader pins the page for them.
struct PageLoad {
  uint32_t waiting_threads = 0;
  bool done = false;
  bool abandoned = false;  // never read after all: whoever waited tries again
  std::optional<Error> error;
};

struct PageCache::State {
  State(const PageFile& page_file, uint64_t capacity, PageCheck page_check, WaitingWork waiting_work,
        const std::string& eviction_name)
      : file(page_file),
        capacity_bytes(capacity),
        check(std::move(page_check)),
        waiting(std::move(waiting_work)),
        eviction(make_eviction_policy(waiting ? eviction_name : "least-recent")),
        slots(std::make_unique<PageSlot[]>(page_file.page_count())) {
    residents.reserve(page_file.page_count());
    for (PageId page = 0; page < page_file.page_count(); ++page)
      slots[page].bytes = page_file.record(page).raw_bytes;
  }

  uint32_t page_bytes(PageId page) const { return slots[page].bytes; }
  bool try_pin(PageId page);
  void release(PageId page);

  // Requires the lock, all of these.
  Status load(PageId page, PageLoad& load, std::unique_lock<std::mutex>& lock, CacheCounters& counters);
  Result<std::byte*> make_room(uint32_t bytes, std::unique_lock<std::mutex>& lock, CacheCounters& counters);
  void wait_for_room(std::unique_lock<std::mutex>& lock, CacheCounters& counters);
  /// Room for a prefetch at the cost of pages that are worth less than `work` only; nullptr when there is none.
  std::byte* try_make_room(uint32_t bytes, uint64_t work, CacheCounters& counters);
  bool evict_one(CacheCounters& counters, uint64_t below_work = ~0ull);
  uint64_t rank_of(PageId page) const;
  uint64_t worth_of(PageId page) const;
  uint64_t work_of(PageId page) const { return waiting ? waiting(page).waiting : 0; }
  /// Room for the page and its entry among the loads; nullptr (with the reason) when it is not to be read.
  std::byte* begin_prefetch(PageId page, CacheCounters& counters, Prefetch& answer);
  void abandon_prefetch(PageId page, std::byte* data);
  void finish_prefetch(PageId page, std::byte* data, Status status, PageLoader::ReadShare share);
  bool try_evict(PageId page, CacheCounters& counters);
  void rank_candidates();
  void publish(PageId page, std::byte* data, uint32_t pins);
  void account();

  // Outside the lock.
  Status read(PageId page, std::byte* data, CacheCounters& counters) const;
  Status check_read(PageId page, std::byte* data, CacheCounters& counters) const;

  const PageFile& file;
  const uint64_t capacity_bytes;
  const PageCheck check;
  const WaitingWork waiting;
  const MappedPages* mapped = nullptr;  // serves every pin when it is there
  const std::unique_ptr<EvictionPolicy> eviction;
  const std::unique_ptr<PageSlot[]> slots;
  std::atomic<uint64_t> tick{0};
  std::atomic<uint32_t> room_waiters{0};  // threads that sleep until a page is unpinned
  std::atomic<uint64_t> held_bytes{0};    // pages and kept buffers
  std::atomic<uint64_t> peak_bytes{0};

  std::mutex mutex;
  std::condition_variable loaded;
  std::condition_variable unpinned;
  std::vector<PageId> residents;  // in no order
  std::unordered_map<PageId, std::shared_ptr<PageLoad>> loads;
  EvictionOrder order;
  PageBuffers buffers;
  uint64_t used_bytes = 0;  // charges of resident pages and of pages being read

  CacheCounters background;            // of prefetches
  std::optional<Error> first_failure;  // of a prefetch
  std::vector<PageId> prefetched;      // published since take_loaded()
  std::atomic<bool> failed{false};
  std::atomic<uint64_t> background_bytes{0};
  std::unique_ptr<PageLoader> loader;  // nullptr: no prefetching. Last: it ends before what it writes to
};

}  // namespace shoal
