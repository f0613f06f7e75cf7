#include "io/page_buffers.h"

#include <gtest/gtest.h>
#include <sys/mman.h>

#include <cstring>
#include <fstream>
#include <unordered_map>

#include "io/page_cache.h"
#include "tests/support/memory_file_system.h"
#include "tests/support/paged_file.h"
#include "tests/support/sanitized.h"

namespace shoal {
namespace {

void fill(std::byte* data, uint32_t page_bytes) {
  std::memset(data, 0xab, page_bytes);
  PageBuffers::zero_tail(data, page_bytes);
}

bool tail_is_zero(const std::byte* data, uint32_t page_bytes) {
  const std::byte zeros[kPageTailBytes] = {};
  return std::memcmp(data + page_bytes, zeros, kPageTailBytes) == 0;
}

TEST(PageBuffers, ZeroBytesFollowEveryPageHoweverTheBufferWasUsedBefore) {
  PageBuffers buffers;
  const uint32_t sizes[] = {1, 4032, 4033, 4095, 4096, 4097, 8000, 8128, 8129, 8192, 12288, 16384, 16320, 20000};
  for (const uint32_t before : sizes) {
    for (const uint32_t size : sizes) {
      std::byte* first = buffers.take(before).value();
      fill(first, before);
      ASSERT_TRUE(tail_is_zero(first, before)) << before;
      buffers.keep(first, before);
      std::byte* second = buffers.take(size).value();
      fill(second, size);
      EXPECT_TRUE(tail_is_zero(second, size)) << before << " then " << size;
      buffers.keep(second, size);
    }
  }
}

TEST(PageBuffers, ReusesAKeptBufferOfTheSameExtentSize) {
  PageBuffers buffers;
  std::byte* first = buffers.take(100000).value();
  fill(first, 100000);
  buffers.keep(first, 100000);
  EXPECT_EQ(buffers.kept_bytes(), 102400u);
  EXPECT_EQ(buffers.reusable_bytes(70000), 102400u);
  EXPECT_EQ(buffers.reusable_bytes(200000), 0u);
  EXPECT_EQ(buffers.take(70000).value(), first);
  EXPECT_EQ(buffers.kept_bytes(), 0u);
}

TEST(PageBuffers, ReleasesAnythingButTheBufferThatWillBeReused) {
  PageBuffers buffers;
  std::byte* small[2] = {buffers.take(4000).value(), buffers.take(4000).value()};
  std::byte* large = buffers.take(100000).value();
  buffers.keep(small[0], 4000);
  buffers.keep(small[1], 4000);
  buffers.keep(large, 100000);
  buffers.release_other(4000);
  EXPECT_EQ(buffers.reusable_bytes(4000), 4096u);
  const uint64_t spare = buffers.kept_bytes() - buffers.reusable_bytes(4000);
  EXPECT_TRUE(spare == 4096u || spare == 102400u);
  buffers.release_other(4000);
  EXPECT_EQ(buffers.kept_bytes(), buffers.reusable_bytes(4000));
}

uint64_t resident_process_bytes() {
  std::ifstream statm("/proc/self/statm");
  uint64_t size = 0, resident = 0;
  statm >> size >> resident;
  return resident * 4096;
}

TEST(PageBuffers, ResidentMemoryStaysWithinTheCacheWhateverTheSizes) {
  if (testing::kSanitized) GTEST_SKIP() << "a sanitizer's own memory would be counted";
  MemoryFileSystem fs;
  std::vector<PageSpec> pages;
  for (const uint32_t bytes : {4000u, 16384u, 60000u, 70000u, 140000u, 250000u, 300000u}) {
    for (uint32_t i = 0; i < 6000000 / bytes; ++i) pages.push_back({PageKind::kTreelet, bytes});
  }
  const auto file = write_pages(fs, "a", pages);
  constexpr uint64_t kCapacity = 10u << 20, kSlack = 3u << 20;
  CacheCounters counters;
  const uint64_t before = resident_process_bytes();
  PageCache cache(*file, kCapacity);
  // One size after the other, then all mixed: freed memory of one size must serve the others.
  for (PageId id = 0; id < pages.size(); ++id) {
    ASSERT_TRUE(cache.pin(id, counters).ok());
    if (id % 64 != 0) continue;
    ASSERT_LE(resident_process_bytes(), before + kCapacity + kSlack) << id;
  }
  for (uint64_t i = 0; i < pages.size(); ++i) {
    ASSERT_TRUE(cache.pin(static_cast<PageId>(i * 7919 % pages.size()), counters).ok());
    if (i % 64 != 0) continue;
    ASSERT_LE(resident_process_bytes(), before + kCapacity + kSlack) << i;
  }
  EXPECT_LE(cache.peak_resident_bytes(), kCapacity);
  EXPECT_GT(resident_process_bytes(), before + kCapacity / 2);  // the test looks at the right thing
}

}  // namespace
}  // namespace shoal
