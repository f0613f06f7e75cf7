#include <gtest/gtest.h>

#include <atomic>
#include <cstring>
#include <thread>

#include "io/page_cache.h"
#include "tests/support/faulty_file_system.h"
#include "tests/support/memory_file_system.h"
#include "tests/support/paged_file.h"

namespace shoal {
namespace {

constexpr std::chrono::microseconds kWait{100000};

class PrefetchingCache : public ::testing::Test {
 protected:
  /// `work[page]` waits for each page.
  void open(uint32_t page_count, uint32_t capacity_pages, const PagingOptions& paging = {}) {
    file = write_pages(faulty, "a", std::vector<PageSpec>(page_count, PageSpec{PageKind::kTreelet, 4096}));
    work = std::vector<std::atomic<uint64_t>>(page_count);
    cache = std::make_unique<PageCache>(
        *file, uint64_t{capacity_pages} * 4096, PageCheck(), [this](PageId page) { return PageDemand(work[page]); },
        paging);
  }
  Prefetch prefetch(PageId page) { return cache->prefetch(page, counters); }
  /// Starts a read and sees it end.
  Prefetch bring(PageId page) {
    const Prefetch answer = prefetch(page);
    cache->finish_loads();
    return answer;
  }

  MemoryFileSystem fs;
  FaultyFileSystem faulty{fs};
  std::unique_ptr<PageFile> file;
  std::vector<std::atomic<uint64_t>> work;
  std::unique_ptr<PageCache> cache;
  CacheCounters counters;
};

TEST_F(PrefetchingCache, APageThatWasBroughtIsAHitWithTheRightBytes) {
  open(5, 5);
  for (PageId id = 0; id < 5; ++id) EXPECT_EQ(bring(id), Prefetch::kStarted);
  for (PageId id = 0; id < 5; ++id) {
    EXPECT_TRUE(cache->resident(id));
    const auto pin = cache->pin(id, counters);
    ASSERT_TRUE(pin.ok());
    const auto expected = page_bytes(id, 4096);
    EXPECT_EQ(std::memcmp(pin.value().bytes().data(), expected.data(), 4096), 0);
  }
  EXPECT_EQ(counters.page_hits_count, 5u);
  EXPECT_EQ(counters.page_misses_count, 0u);
  const CacheCounters background = cache->background_counters();
  EXPECT_EQ(background.page_prefetches_count, 5u);
  EXPECT_EQ(background.treelet_loads_count, 5u);
  EXPECT_EQ(background.disk_read_bytes, cache->background_read_bytes());
  EXPECT_GT(background.disk_read_bytes, 0u);
}

TEST_F(PrefetchingCache, BringsTwoNeighboursWithOneRead) {
  open(6, 6);
  EXPECT_EQ(cache->prefetch_pair(2, counters), Prefetch::kStarted);
  cache->finish_loads();
  for (const PageId id : {2u, 3u}) {
    const auto pin = cache->pin(id, counters);
    ASSERT_TRUE(pin.ok());
    EXPECT_EQ(std::memcmp(pin.value().bytes().data(), page_bytes(id, 4096).data(), 4096), 0);
  }
  EXPECT_EQ(counters.page_hits_count, 2u);
  EXPECT_EQ(cache->background_counters().disk_reads_count, 1u);
  EXPECT_EQ(cache->background_counters().page_prefetches_count, 2u);
  // One of the two is there already: only the other is read.
  EXPECT_EQ(bring(5), Prefetch::kStarted);
  EXPECT_EQ(cache->prefetch_pair(4, counters), Prefetch::kNotNeeded);
  cache->finish_loads();
  EXPECT_TRUE(cache->resident(4));
  EXPECT_EQ(cache->background_counters().disk_reads_count, 3u);
}

TEST_F(PrefetchingCache, ADamagedNeighbourHarmsOnlyItself) {
  open(4, 4);
  std::vector<std::byte> bytes(file->file_bytes());
  ASSERT_TRUE(fs.open("a", ReadMode::kBuffered).value()->read_at(0, bytes).ok());
  bytes[file->stored_range(2).offset] ^= std::byte{1};
  ASSERT_TRUE(write_whole_file(fs, "b", bytes).ok());
  const auto damaged = PageFile::open(fs, "b", ReadMode::kBuffered);
  ASSERT_TRUE(damaged.ok());
  PageCache other(*damaged.value(), 1u << 20, PageCheck(), [](PageId) { return PageDemand(); });
  EXPECT_EQ(other.prefetch_pair(1, counters), Prefetch::kStarted);
  other.finish_loads();
  EXPECT_TRUE(other.resident(1));
  EXPECT_FALSE(other.resident(2));
  ASSERT_FALSE(other.failure().ok());
  EXPECT_EQ(other.failure().error().code, ErrorCode::kCorrupt);
}

TEST_F(PrefetchingCache, WhatIsResidentOrOnItsWayIsNotReadAgain) {
  open(2, 2);
  EXPECT_EQ(bring(0), Prefetch::kStarted);
  EXPECT_EQ(prefetch(0), Prefetch::kNotNeeded);
  EXPECT_EQ(cache->background_counters().disk_reads_count, 1u);
}

TEST_F(PrefetchingCache, TakesTheRoomOfPagesWithLessWorkOnly) {
  open(4, 2);
  work[0] = 10, work[1] = 20, work[2] = 10, work[3] = 15;
  bring(0), bring(1);
  EXPECT_EQ(bring(2), Prefetch::kNoRoom);
  EXPECT_TRUE(cache->resident(0) && cache->resident(1));
  EXPECT_EQ(bring(3), Prefetch::kStarted);
  EXPECT_FALSE(cache->resident(0));
  EXPECT_TRUE(cache->resident(1) && cache->resident(3));
}

TEST_F(PrefetchingCache, NeverTakesTheRoomOfAPinnedPage) {
  open(3, 2);
  work[2] = 1000;
  const auto first = cache->pin(0, counters), second = cache->pin(1, counters);
  EXPECT_EQ(bring(2), Prefetch::kNoRoom);
  EXPECT_TRUE(cache->resident(0) && cache->resident(1));
}

TEST_F(PrefetchingCache, SaysBusyWhenAllReadsAreUnderWay) {
  open(64, 64, {.read_depth = 2});
  unsigned started = 0, busy = 0;
  for (PageId id = 0; id < 64; ++id) {
    const Prefetch answer = prefetch(id);
    started += answer == Prefetch::kStarted;
    busy += answer == Prefetch::kBusy;
    EXPECT_LE(cache->loading_count(), 3u);  // one that has just ended may still be counted
  }
  cache->finish_loads();
  EXPECT_EQ(started + busy, 64u);
  EXPECT_EQ(cache->background_counters().page_prefetches_count, started);
  EXPECT_EQ(cache->loading_count(), 0u);
}

TEST_F(PrefetchingCache, WithoutReadsAheadNothingIsStarted) {
  open(2, 2, {.read_depth = 0});
  EXPECT_EQ(bring(0), Prefetch::kBusy);
  EXPECT_FALSE(cache->resident(0));
}

TEST_F(PrefetchingCache, TellsWhatHasComeOnce) {
  open(3, 3);
  bring(2), bring(0);
  std::vector<PageId> pages;
  cache->take_loaded(pages);
  std::sort(pages.begin(), pages.end());
  EXPECT_EQ(pages, (std::vector<PageId>{0, 2}));
  cache->take_loaded(pages);
  EXPECT_TRUE(pages.empty());
  prefetch(1);
  while (cache->loading_count() > 0 && pages.empty()) {
    cache->wait_for_load(kWait);
    cache->take_loaded(pages);
  }
  if (pages.empty()) cache->take_loaded(pages);
  EXPECT_EQ(pages, (std::vector<PageId>{1}));
}

TEST_F(PrefetchingCache, KeepsTheErrorOfAReadAndStaysUsable) {
  open(3, 3);
  for (const Fault fault : {Fault::kIoError, Fault::kShortRead, Fault::kBitFlip}) {
    open(3, 3);
    EXPECT_TRUE(cache->failure().ok());
    faulty.arm(fault, 0);
    bring(1);
    faulty.arm(Fault::kNone, 0);
    const Status failure = cache->failure();
    ASSERT_FALSE(failure.ok());
    EXPECT_EQ(failure.error().code, fault == Fault::kBitFlip ? ErrorCode::kCorrupt : ErrorCode::kStorage);
    EXPECT_FALSE(cache->resident(1));
    EXPECT_TRUE(cache->pin(1, counters).ok());
  }
}

TEST_F(PrefetchingCache, WhoPinsAPageOnItsWayWaitsForIt) {
  constexpr uint32_t kPages = 200;
  for (const ReadBackend backend : {ReadBackend::kAuto, ReadBackend::kThreads}) {
    open(kPages, kPages, {.read_depth = 16, .loader_threads = 2, .backend = backend});
    std::thread ahead([this] {
      CacheCounters mine;
      for (PageId id = 0; id < kPages; ++id) cache->prefetch(id, mine);
    });
    for (PageId id = 0; id < kPages; ++id) {
      const auto pin = cache->pin(id, counters);
      ASSERT_TRUE(pin.ok());
      EXPECT_EQ(std::memcmp(pin.value().bytes().data(), page_bytes(id, 4096).data(), 4096), 0);
    }
    ahead.join();
    cache->finish_loads();
    const CacheCounters background = cache->background_counters();
    EXPECT_EQ(counters.page_misses_count + background.page_prefetches_count, kPages);
    counters = {};
  }
}

TEST_F(PrefetchingCache, ManyThreadsPinAndPrefetchInLittleRoom) {
  constexpr uint32_t kPages = 60;
  open(kPages, 8, {.read_depth = 4, .loader_threads = 2});
  std::atomic<uint64_t> misses{0}, evictions{0};
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      CacheCounters mine;
      uint64_t random = t + 1;
      for (int i = 0; i < 3000; ++i) {
        random = random * 6364136223846793005ull + 1442695040888963407ull;
        const PageId page = static_cast<PageId>((random >> 33) % kPages);
        work[page] = (random >> 20) % 100;
        if (i % 3 == 0) {
          cache->prefetch(page, mine);
          continue;
        }
        const auto pin = cache->pin(page, mine);
        ASSERT_TRUE(pin.ok());
        EXPECT_EQ(std::memcmp(pin.value().bytes().data(), page_bytes(page, 4096).data(), 4096), 0);
      }
      misses += mine.page_misses_count, evictions += mine.page_evictions_count;
    });
  }
  for (std::thread& thread : threads) thread.join();
  cache->finish_loads();
  EXPECT_LE(cache->peak_resident_bytes(), cache->capacity_bytes());
  const CacheCounters background = cache->background_counters();
  uint32_t resident = 0;
  for (PageId id = 0; id < kPages; ++id) resident += cache->resident(id);
  EXPECT_EQ(misses + background.page_prefetches_count, evictions + resident);
}

}  // namespace
}  // namespace shoal
