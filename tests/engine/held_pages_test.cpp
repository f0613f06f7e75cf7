#include "engine/held_pages.h"

#include <gtest/gtest.h>

#include "tests/support/memory_file_system.h"
#include "tests/support/paged_file.h"

namespace shoal {
namespace {

constexpr uint32_t kMost = 32;

/// 100 treelets and a few pages of the other kinds; the largest of each kind take 16 KiB together.
std::vector<PageSpec> pages() {
  std::vector<PageSpec> specs(100, PageSpec{PageKind::kTreelet, 8192});
  specs.push_back({PageKind::kAttributes, 4096});
  specs.push_back({PageKind::kTexture, 4000});
  return specs;
}

class RaysUnderWay : public ::testing::Test {
 protected:
  uint32_t with_capacity(uint64_t bytes, unsigned threads) {
    return rays_under_way(PageCache(*file_, bytes), *file_, threads, kMost);
  }

  MemoryFileSystem fs_;
  std::unique_ptr<PageFile> file_ = write_pages(fs_, "pages", pages());
  uint64_t every_ = PageCache::every_page_bytes(*file_);
  uint64_t least_ = PageCache::minimum_capacity_bytes(*file_, 1);
};

TEST_F(RaysUnderWay, EveryPageIsWhatPinningThemAllTakes) {
  PageCache cache(*file_, every_);
  CacheCounters counters;
  std::vector<PagePin> pins;
  for (PageId page = 0; page < file_->page_count(); ++page) {
    auto pin = cache.pin(page, counters);
    ASSERT_TRUE(pin.ok()) << pin.error().message;
    pins.push_back(std::move(pin).value());
  }
  EXPECT_EQ(pins.size(), 102u);
  EXPECT_EQ(cache.resident_bytes(), every_);
  EXPECT_EQ(counters.page_evictions_count, 0u);
}

TEST_F(RaysUnderWay, AreAsManyAsWantedWhereEveryPageHasRoom) {
  EXPECT_EQ(with_capacity(every_, 1), kMost);
  EXPECT_EQ(with_capacity(every_, 64), kMost);
}

TEST_F(RaysUnderWay, HoldAnEighthOfTheCacheWhereSomePageHasNone) {
  const uint64_t capacity = every_ - 1;
  EXPECT_EQ(with_capacity(capacity, 1), capacity / 8 / least_);
  EXPECT_LT(with_capacity(capacity, 1), kMost);
  EXPECT_EQ(with_capacity(capacity, 2), capacity / 16 / least_);
  EXPECT_EQ(with_capacity(capacity, 64), 1u) << "at least one";
  EXPECT_EQ(with_capacity(least_, 1), 1u);
}

}  // namespace
}  // namespace shoal
