#include "io/page_cache.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <barrier>
#include <chrono>
#include <cstring>
#include <set>
#include <thread>

#include "tests/support/faulty_file_system.h"
#include "tests/support/memory_file_system.h"
#include "tests/support/paged_file.h"

namespace shoal {
namespace {

uint64_t block_bytes(uint32_t bytes) { return (uint64_t{bytes} + 4095) / 4096 * 4096; }

std::vector<PageSpec> equal_pages(uint32_t count, uint32_t bytes = 4096) {
  return std::vector<PageSpec>(count, PageSpec{PageKind::kTreelet, bytes});
}

uint32_t random_below(uint64_t& state, uint32_t limit) {
  state = state * 6364136223846793005ull + 1442695040888963407ull;
  return static_cast<uint32_t>((state >> 33) % limit);
}

void expect_page(const PagePin& pin, PageId id, uint32_t bytes) {
  ASSERT_TRUE(pin);
  EXPECT_EQ(pin.page(), id);
  EXPECT_EQ(reinterpret_cast<uintptr_t>(pin.bytes().data()) % 64, 0u);
  const auto expected = page_bytes(id, bytes);
  ASSERT_EQ(pin.bytes().size(), expected.size());
  EXPECT_EQ(std::memcmp(pin.bytes().data(), expected.data(), expected.size()), 0);
  const std::byte zeros[64] = {};
  EXPECT_EQ(std::memcmp(pin.bytes().data() + bytes, zeros, 64), 0) << "page " << id;
}

TEST(PageCache, GivesThePagesAndCountsThem) {
  MemoryFileSystem fs;
  const std::vector<PageSpec> pages = {{PageKind::kTreelet, 100000}, {PageKind::kAttributes, 1},
                                       {PageKind::kTexture, 16384},  {PageKind::kTreelet, 4032},
                                       {PageKind::kTreelet, 4033},   {PageKind::kTreelet, 4096}};
  const auto file = write_pages(fs, "a", pages);
  PageCache cache(*file, 1u << 20);
  CacheCounters counters;
  for (int round = 0; round < 2; ++round) {
    for (PageId id = 0; id < pages.size(); ++id) {
      EXPECT_EQ(cache.resident(id), round == 1);
      auto pin = cache.pin(id, counters);
      ASSERT_TRUE(pin.ok());
      expect_page(pin.value(), id, pages[id].bytes);
      EXPECT_TRUE(cache.resident(id));
    }
  }
  uint64_t stored = 0, charged = 0, decoded = 0;
  for (const PageRecord& r : file->records()) {
    stored += block_bytes(r.stored_bytes);
    charged += block_bytes(r.raw_bytes);
    decoded += r.raw_bytes;
  }
  EXPECT_EQ(counters.page_requests_count, 12u);
  EXPECT_EQ(counters.page_hits_count, 6u);
  EXPECT_EQ(counters.page_misses_count, 6u);
  EXPECT_EQ(counters.page_evictions_count, 0u);
  EXPECT_EQ(counters.disk_reads_count, 6u);
  EXPECT_EQ(counters.disk_read_bytes, stored);
  EXPECT_EQ(counters.decoded_bytes, decoded);
  EXPECT_EQ(counters.treelet_loads_count, 4u);
  EXPECT_EQ(counters.treelet_load_bytes, 100000u + 4032 + 4033 + 4096);
  EXPECT_EQ(counters.attribute_loads_count, 1u);
  EXPECT_EQ(counters.texture_loads_count, 1u);
  EXPECT_EQ(cache.resident_bytes(), charged);
  EXPECT_EQ(cache.peak_resident_bytes(), charged);
}

TEST(PageCache, OnlyPagesThatAreNotThereTakeTime) {
  MemoryFileSystem fs;
  const auto file = write_pages(fs, "pages", equal_pages(2));
  PageCache cache(*file, 2 * block_bytes(4096));
  CacheCounters counters;
  ASSERT_TRUE(cache.pin(0, counters).ok());
  const uint64_t waited = counters.waited_ticks;
  EXPECT_GT(waited, 0u);
  ASSERT_TRUE(cache.pin(0, counters).ok());
  EXPECT_EQ(counters.waited_ticks, waited) << "a hit";
  ASSERT_TRUE(cache.pin(1, counters).ok());
  EXPECT_GT(counters.waited_ticks, waited);
}

TEST(PageCache, EvictsOnlyUnpinnedPages) {
  MemoryFileSystem fs;
  const auto file = write_pages(fs, "a", equal_pages(20));
  PageCache cache(*file, 3 * 4096);
  CacheCounters counters;
  const auto first = cache.pin(0, counters);
  const auto second = cache.pin(1, counters);
  for (PageId id = 2; id < 20; ++id) {
    expect_page(cache.pin(id, counters).value(), id, 4096);
    EXPECT_TRUE(cache.resident(0) && cache.resident(1) && cache.resident(id));
    EXPECT_LE(cache.resident_bytes(), cache.capacity_bytes());
  }
  expect_page(first.value(), 0, 4096);
  expect_page(second.value(), 1, 4096);
  EXPECT_EQ(counters.page_evictions_count, 17u);
}

/// Least recent use as the cache defines it: by the number of loads before the use, hits after the load itself.
void compare_with_plain_lru(uint32_t page_count, uint32_t capacity_pages, unsigned requests) {
  MemoryFileSystem fs;
  const auto file = write_pages(fs, "a", equal_pages(page_count));
  PageCache cache(*file, uint64_t{capacity_pages} * 4096);
  CacheCounters counters;
  std::vector<uint64_t> last_use(page_count, 0);
  std::set<PageId> resident;
  uint64_t loads = 0, random = 7;
  for (unsigned i = 0; i < requests; ++i) {
    const PageId id = std::min(random_below(random, page_count), random_below(random, page_count));
    if (resident.contains(id)) {
      last_use[id] = 2 * loads + 1;
    } else {
      if (resident.size() == capacity_pages) {
        resident.erase(*std::min_element(resident.begin(), resident.end(),
                                         [&](PageId a, PageId b) { return last_use[a] < last_use[b]; }));
      }
      resident.insert(id);
      last_use[id] = 2 * ++loads;
    }
    ASSERT_TRUE(cache.pin(id, counters).ok());
    ASSERT_EQ(counters.page_misses_count, loads) << "request " << i;
  }
  for (PageId id = 0; id < page_count; ++id) EXPECT_EQ(cache.resident(id), resident.contains(id)) << id;
}

TEST(PageCache, EvictsLeastRecentlyUsedWithoutWaitingWork) { compare_with_plain_lru(40, 13, 4000); }
TEST(PageCache, EvictsLeastRecentlyUsedAmongThousandsOfPages) { compare_with_plain_lru(1800, 900, 6000); }

TEST(PageCache, EvictsThePageForWhichLeastWorkWaits) {
  MemoryFileSystem fs;
  constexpr uint32_t kPages = 60, kCapacity = 20;
  const auto file = write_pages(fs, "a", equal_pages(kPages));
  std::vector<uint64_t> work(kPages);
  PageCache cache(*file, kCapacity * 4096, {}, [&](PageId id) { return work[id]; });
  CacheCounters counters;
  std::set<PageId> resident;
  std::vector<uint64_t> loaded_at(kPages);
  uint64_t random = 3;
  for (unsigned i = 0; i < 2000; ++i) {
    const PageId id = random_below(random, kPages);
    work[random_below(random, kPages)] = random_below(random, 5);
    if (resident.contains(id)) continue;
    if (resident.size() == kCapacity) {
      resident.erase(*std::min_element(resident.begin(), resident.end(), [&](PageId a, PageId b) {
        return std::pair(work[a], loaded_at[a]) < std::pair(work[b], loaded_at[b]);
      }));
    }
    resident.insert(id);
    loaded_at[id] = i;
    ASSERT_TRUE(cache.pin(id, counters).ok());
    for (PageId p = 0; p < kPages; ++p) ASSERT_EQ(cache.resident(p), resident.contains(p)) << i << " " << p;
  }
}

TEST(PageCache, KeepsPagesWithMuchWaitingWorkAmongThousands) {
  MemoryFileSystem fs;
  constexpr uint32_t kPages = 4000, kCapacity = 2000;
  const auto file = write_pages(fs, "a", equal_pages(kPages));
  // Every fourth page is wanted; there is room for all of them and as many again.
  PageCache cache(*file, uint64_t{kCapacity} * 4096, {}, [](PageId id) { return id % 4 == 0 ? 100 : 0; });
  CacheCounters counters;
  for (PageId id = 0; id < kPages; ++id) ASSERT_TRUE(cache.pin(id, counters).ok());
  for (PageId id = 0; id < kPages; id += 4) EXPECT_TRUE(cache.resident(id)) << id;
}

TEST(PageCache, ReadsAPageOnceForManyThreads) {
  MemoryFileSystem memory;
  FaultyFileSystem fs(memory);
  const auto file = write_pages(fs, "a", equal_pages(8, 300000));
  fs.arm(Fault::kShortRead, ~0ull);  // counts the reads
  PageCache cache(*file, block_bytes(300000));
  constexpr unsigned kThreads = 8;
  std::vector<CacheCounters> counters(kThreads);
  std::barrier together(kThreads);
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      for (PageId id = 0; id < 8; ++id) {
        together.arrive_and_wait();
        const auto pin = cache.pin(id, counters[t]);
        ASSERT_TRUE(pin.ok());
        EXPECT_EQ(pin.value().page(), id);
        together.arrive_and_wait();  // all hold it at once
      }
    });
  }
  for (auto& thread : threads) thread.join();
  CacheCounters sum;
  for (const auto& c : counters) sum.add(c);
  EXPECT_EQ(sum.page_misses_count, 8u);
  EXPECT_EQ(sum.page_hits_count, 8u * (kThreads - 1));
  EXPECT_EQ(fs.calls(), 8u);
}

TEST(PageCache, WaitsForAnUnpinWhenEverythingIsPinned) {
  MemoryFileSystem fs;
  const auto file = write_pages(fs, "a", equal_pages(2));
  PageCache cache(*file, 4096);
  CacheCounters mine, theirs;
  auto held = cache.pin(0, mine);
  std::atomic<bool> got{false};
  std::thread other([&] {
    const auto pin = cache.pin(1, theirs);
    EXPECT_TRUE(pin.ok());
    expect_page(pin.value(), 1, 4096);
    got = true;
  });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_FALSE(got);
  expect_page(held.value(), 0, 4096);
  held.value().reset();
  other.join();
  EXPECT_TRUE(got);
  EXPECT_FALSE(cache.resident(0));
}

TEST(PageCache, RefusesAPageLargerThanItself) {
  MemoryFileSystem fs;
  const auto file = write_pages(fs, "a", {{PageKind::kTreelet, 5000}, {PageKind::kTreelet, 4000}});
  PageCache cache(*file, 4096);
  CacheCounters counters;
  EXPECT_EQ(cache.pin(0, counters).error().code, ErrorCode::kMemoryCap);
  EXPECT_TRUE(cache.pin(1, counters).ok());
}

TEST(PageCache, StaysUsableAfterAFailedLoad) {
  MemoryFileSystem memory;
  FaultyFileSystem fs(memory);
  const auto file = write_pages(fs, "a", equal_pages(3));
  PageCache cache(*file, 4096);
  CacheCounters counters;
  const std::pair<Fault, ErrorCode> cases[] = {{Fault::kIoError, ErrorCode::kStorage},
                                               {Fault::kShortRead, ErrorCode::kStorage},
                                               {Fault::kBitFlip, ErrorCode::kCorrupt}};
  for (const auto& [fault, code] : cases) {
    fs.arm(fault, 0);
    const auto failed = cache.pin(1, counters);
    ASSERT_FALSE(failed.ok());
    EXPECT_EQ(failed.error().code, code);
    EXPECT_NE(failed.error().message.find("a"), std::string::npos);
    EXPECT_FALSE(cache.resident(1));
    fs.arm(Fault::kNone, 0);
    expect_page(cache.pin(1, counters).value(), 1, 4096);
    expect_page(cache.pin(2, counters).value(), 2, 4096);
  }
  EXPECT_EQ(counters.page_requests_count, counters.page_hits_count + counters.page_misses_count);
}

TEST(PageCache, WakesEveryWaiterWithTheErrorOfAFailedLoad) {
  MemoryFileSystem memory;
  FaultyFileSystem fs(memory);
  const auto file = write_pages(fs, "a", equal_pages(4, 300000));
  fs.arm(Fault::kIoError, 0, true);
  PageCache cache(*file, 1u << 20);
  constexpr unsigned kThreads = 6;
  std::atomic<unsigned> failures{0};
  std::barrier together(kThreads);
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < kThreads; ++t) {
    threads.emplace_back([&] {
      CacheCounters counters;
      for (PageId id = 0; id < 4; ++id) {
        together.arrive_and_wait();
        const auto pin = cache.pin(id, counters);
        failures += !pin.ok() && pin.error().code == ErrorCode::kStorage;
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(failures, 4 * kThreads);
  fs.arm(Fault::kNone, 0);
  CacheCounters counters;
  expect_page(cache.pin(0, counters).value(), 0, 300000);
}

TEST(PageCache, ChecksAPageOnceALoadAndKeepsOutWhatFails) {
  MemoryFileSystem fs;
  const auto file = write_pages(fs, "a", equal_pages(3));
  unsigned checks = 0;
  PageCache cache(*file, 1u << 20, [&](const PageRecord& record, std::span<const std::byte> bytes) -> Status {
    ++checks;
    EXPECT_EQ(bytes.size(), record.raw_bytes);
    if (record.id == 2) return Error{ErrorCode::kCorrupt, "page 2 is not sound"};
    return {};
  });
  CacheCounters counters;
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(cache.pin(0, counters).ok() && cache.pin(1, counters).ok());
  EXPECT_EQ(checks, 2u);
  EXPECT_EQ(cache.pin(2, counters).error().message, "page 2 is not sound");
  EXPECT_FALSE(cache.resident(2));
}

/// Threads that hold up to a treelet, its attributes and a texture tile, over a cache of the smallest size that is
/// promised to work and of larger ones.
void run_many_threads(unsigned threads, uint64_t extra_bytes, bool with_work) {
  MemoryFileSystem fs;
  std::vector<PageSpec> pages;
  uint64_t random = threads + extra_bytes;
  for (int i = 0; i < 30; ++i) {
    pages.push_back({PageKind::kTreelet, 1 + random_below(random, 40000)});
    pages.push_back({PageKind::kAttributes, 1 + random_below(random, 9000)});
    pages.push_back({PageKind::kTexture, 16384});
  }
  const auto file = write_pages(fs, "a", pages);
  std::vector<std::byte> last_bytes;
  for (PageId id = 0; id < pages.size(); ++id) last_bytes.push_back(page_bytes(id, pages[id].bytes).back());
  std::vector<std::atomic<uint64_t>> work(pages.size());
  WaitingWork waiting;
  if (with_work) waiting = [&](PageId id) { return work[id].load(std::memory_order_relaxed); };
  PageCache cache(*file, PageCache::minimum_capacity_bytes(*file, threads) + extra_bytes, {}, waiting);
  std::vector<CacheCounters> counters(threads);
  std::atomic<bool> over{false};
  const auto visit = [&](unsigned t) {
    uint64_t dice = t + 1;
    for (int i = 0; i < 1000; ++i) {
      const PageId object = random_below(dice, 30) * 3;
      work[object].store(random_below(dice, 100), std::memory_order_relaxed);
      const unsigned held = 1 + random_below(dice, 3);
      PagePin pins[3];
      for (unsigned p = 0; p < held; ++p) {
        auto pin = cache.pin(object + p, counters[t]);
        ASSERT_TRUE(pin.ok());
        pins[p] = std::move(pin).value();
        if (i % 64 == 0) expect_page(pins[p], object + p, pages[object + p].bytes);
      }
      if (cache.resident_bytes() > cache.capacity_bytes()) over = true;
      for (unsigned p = 0; p < held; ++p) {
        EXPECT_TRUE(cache.resident(object + p));
        EXPECT_EQ(pins[p].bytes().back(), last_bytes[object + p]);
      }
    }
  };
  std::vector<std::thread> running;
  for (unsigned t = 0; t < threads; ++t) running.emplace_back(visit, t);
  for (auto& thread : running) thread.join();
  CacheCounters sum;
  for (const auto& c : counters) sum.add(c);
  EXPECT_FALSE(over);
  EXPECT_LE(cache.peak_resident_bytes(), cache.capacity_bytes());
  EXPECT_EQ(sum.page_requests_count, sum.page_hits_count + sum.page_misses_count);
  EXPECT_EQ(sum.disk_reads_count, sum.page_misses_count);
  EXPECT_EQ(sum.treelet_loads_count + sum.attribute_loads_count + sum.texture_loads_count, sum.page_misses_count);
  uint64_t resident = 0;
  for (PageId id = 0; id < pages.size(); ++id) resident += cache.resident(id);
  EXPECT_EQ(sum.page_misses_count - sum.page_evictions_count, resident);
}

TEST(PageCache, GetsOnWithTheSmallestCapacity) { run_many_threads(4, 0, false); }
TEST(PageCache, GetsOnWithTheSmallestCapacityAndWaitingWork) { run_many_threads(4, 0, true); }
TEST(PageCache, CountsAddUpWithManyThreads) { run_many_threads(8, 300000, false); }
TEST(PageCache, CountsAddUpWithWaitingWork) { run_many_threads(8, 300000, true); }

TEST(PageCache, GetsOnWhenManyThreadsShareRoomForOnePage) {
  MemoryFileSystem fs;
  const auto file = write_pages(fs, "a", equal_pages(6));
  PageCache cache(*file, 4096);
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < 6; ++t) {
    threads.emplace_back([&, t] {
      CacheCounters counters;
      uint64_t random = t;
      for (int i = 0; i < 400; ++i) {
        const PageId id = random_below(random, 6);
        const auto pin = cache.pin(id, counters);
        ASSERT_TRUE(pin.ok());
        EXPECT_EQ(pin.value().page(), id);
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(cache.peak_resident_bytes(), 4096u);
}

}  // namespace
}  // namespace shoal
