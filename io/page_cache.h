// The page cache: decoded pages of one PageFile under one budget, pinned while in use.
//
// Properties and assumptions
//   capacity   the sum of resident pages (rounded up to 4 KiB each) never exceeds capacity_bytes.
//   ownership  a PagePin keeps its page resident; pins are short (one batch, one visit).
//   threads    any number; two threads that miss the same page read it once, the second waits.
//   order      among unpinned pages the one that the eviction policy ranks lowest goes first, ties by least recent
//              use; with no WaitingWork this is plain LRU. Exact up to 512 resident pages; above, waiting work may
//              be stale by one page in 16 (eviction_order.h).
//   prefetch   prefetch() starts a read and returns; a loader thread verifies, decodes and publishes the page. It takes
//              the room of a page only when that one is worth less than the work that waits (EvictionPolicy::worth), so it
//              cannot thrash, and never waits.
//   when full  pin() waits for another thread's pin to end when everything resident is pinned. This
//              cannot deadlock as long as capacity_bytes >= minimum_capacity_bytes(): each thread holds at most
//              kMaxPinsPerThread pages, or what fits in an eighth with other threads; any where every page fits.
//   cost       a hit is one atomic increment and no lock; a miss reads, hashes and decompresses outside the lock; a
//              prefetch takes the lock and one system call.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "io/eviction_policy.h"
#include "io/page_file.h"
#include "io/page_loader.h"
#include "io/result.h"

namespace shoal {

/// Texture tiles that a thread may have pinned at a time.
inline constexpr unsigned kPinnedTilesPerThread = 8;

/// Counted by the caller's thread, summed by the render (engine/counters.h names them).
struct CacheCounters {
  uint64_t page_requests_count = 0;  ///< = hits + misses
  uint64_t page_hits_count = 0;
  uint64_t page_misses_count = 0;
  uint64_t page_prefetches_count = 0;  ///< pages read ahead by prefetch()
  uint64_t page_evictions_count = 0;
  uint64_t disk_reads_count = 0;
  uint64_t disk_read_bytes = 0;      ///< bytes asked of the disk
  uint64_t decoded_bytes = 0;        ///< bytes of decoded pages
  uint64_t treelet_loads_count = 0;  ///< kTreelet pages read
  uint64_t treelet_load_bytes = 0;   ///< decoded bytes of those
  uint64_t attribute_loads_count = 0;
  uint64_t texture_loads_count = 0;
  uint64_t waited_ticks = 0;  ///< in pin(), for pages that were not there: reading, decoding, waiting (io/ticks.h)

  void add(const CacheCounters& other);
};

class MappedPages;
class PageCache;

/// Keeps one page resident. Movable; the destructor lets go.
class PagePin {
 public:
  PagePin() = default;
  PagePin(PagePin&& other) noexcept;
  PagePin& operator=(PagePin&& other) noexcept;
  PagePin(const PagePin&) = delete;
  PagePin& operator=(const PagePin&) = delete;
  ~PagePin();

  explicit operator bool() const { return data_ != nullptr; }
  PageId page() const { return page_; }
  /// The decoded page, aligned to 4 KiB; 64 readable zero bytes follow the end (SIMD loads).
  std::span<const std::byte> bytes() const { return {data_, size_}; }
  void reset();

 private:
  friend class PageCache;
  PagePin(PageCache& cache, PageId page, const std::byte* data, uint32_t size);
  PageCache* cache_ = nullptr;
  const std::byte* data_ = nullptr;
  uint32_t size_ = 0;
  PageId page_ = kNoPage;
};

/// Looks over a page once, when it has been decoded, so that its readers need not check it again.
/// Fails with: kCorrupt. Called from any thread, outside the lock.
using PageCheck = std::function<Status(const PageRecord&, std::span<const std::byte>)>;

enum class Prefetch : uint8_t {
  kStarted,
  kNotNeeded,  ///< resident, or being read already
  kBusy,       ///< as many reads are under way as may be
  kNoRoom,     ///< everything resident is pinned or worth as much
};

class PageCache {
 public:
  static constexpr unsigned kMaxPinsPerThread = 2 + kPinnedTilesPerThread;  ///< a treelet, its attributes, tiles

  PageCache(const PageFile& file, uint64_t capacity_bytes, PageCheck check = {}, WaitingWork waiting = {},
            const PagingOptions& paging = {});
  ~PageCache();

  /// The smallest capacity with which `threads` threads always get on: the largest page of each kind, a thread,
  /// when each pins one page of a kind at a time, or kPinnedTilesPerThread of textures. Tables are not read through the cache.
  static uint64_t minimum_capacity_bytes(const PageFile& file, unsigned threads);

  /// The capacity that holds every page of the file, tables left out: then nothing is ever evicted.
  static uint64_t every_page_bytes(const PageFile& file);

  /// Memory that the cache takes beside its capacity: its slots, and room to rank what is resident.
  static uint64_t overhead_bytes(const PageFile& file, const PagingOptions& paging = {});

  /// Fails with: kStorage, kCorrupt (after which the render ends), kMemoryCap (a page larger than the capacity). A
  /// thread that waited for another's read of the page counts a hit. Requires: page < page_count() of the file.
  Result<PagePin> pin(PageId page, CacheCounters& counters);
  /// Starts reading a page that will be wanted. A read that fails is kept (failure()): who asked may never pin it.
  /// With read_depth 0 or without WaitingWork the answer for a page that is not resident is always kBusy.
  Prefetch prefetch(PageId page, CacheCounters& counters);
  /// The same for a page and the one after it, with one read where both are wanted and lie side by side.
  Prefetch prefetch_pair(PageId page, CacheCounters& counters);
  /// Moves the pages that prefetches brought since the last call to `pages` (cleared first).
  void take_loaded(std::vector<PageId>& pages);
  /// How pages are read ahead: "io_uring" or "threads"; "none": they are not.
  const char* read_backend() const;
  /// Prefetches under way.
  unsigned loading_count() const;
  /// Sleeps until a prefetch ends or the time is over; returns at once when none is under way or some are not taken yet.
  void wait_for_load(std::chrono::microseconds at_most);
  /// Waits until no prefetch is under way. Requires: none is started meanwhile.
  void finish_loads();
  /// The first prefetch that failed, or ok.
  Status failure() const;
  /// What prefetches read so far. Bytes may be asked for at any time, the rest once no prefetch is under way.
  CacheCounters background_counters() const;
  uint64_t background_read_bytes() const;

  /// From now on every pin is a hit in these pages, and nothing is read or kept. Requires: nothing was pinned yet.
  void serve_from(const MappedPages* pages);
  /// A hint without a promise; used by schedulers to trace what is resident first.
  bool resident(PageId page) const;
  /// Memory held now: resident pages, pages being read, and buffers kept for the next page.
  uint64_t resident_bytes() const;
  uint64_t peak_resident_bytes() const;
  uint64_t capacity_bytes() const;

 private:
  friend class PagePin;
  void unpin(PageId page);
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace shoal
