#include "engine/cache_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <list>
#include <map>
#include <random>

namespace shoal {
namespace {

constexpr uint64_t kLine = 64;

/// 8 sets of 4 ways: 2 KiB.
CacheModel small_cache() { return CacheModel({.levels = {{.bytes = 2048, .ways = 4}}}); }

TEST(CacheModel, FillsEachLineOfAStreamOnce) {
  CacheModel cache(CacheModel::Options{});
  const uint64_t bytes = 8u << 20;
  for (uint64_t at = 0; at < bytes; at += 8) cache.touch(at, 8, false, 0);
  cache.flush();
  EXPECT_EQ(cache.counts().fills, bytes / kLine);
  EXPECT_EQ(cache.counts().write_backs, 0u);
}

TEST(CacheModel, CountsEveryLineThatARangeTouches) {
  CacheModel cache = small_cache();
  cache.touch(60, 8, false, 0);  // two lines
  EXPECT_EQ(cache.counts().fills, 2u);
  cache.touch(64, 64, false, 0);  // the second of them
  EXPECT_EQ(cache.counts().fills, 2u);
  cache.touch(127, 66, false, 0);  // and two more
  EXPECT_EQ(cache.counts().fills, 4u);
}

TEST(CacheModel, KeepsWhatFits) {
  CacheModel cache = small_cache();
  for (int round = 0; round < 3; ++round) {
    for (uint64_t line = 0; line < 32; ++line) cache.touch(line * kLine, 1, false, 0);
  }
  EXPECT_EQ(cache.counts().fills, 32u);
}

TEST(CacheModel, LosesEveryLineOfALoopOneLineTooLongForItsSet) {
  CacheModel cache = small_cache();
  const uint64_t stride = 8 * kLine;  // always the same set
  for (int round = 0; round < 3; ++round) {
    for (uint64_t i = 0; i < 5; ++i) cache.touch(i * stride, 1, false, 0);
  }
  EXPECT_EQ(cache.counts().fills, 15u);
}

TEST(CacheModel, EvictsTheLeastRecentlyTouched) {
  CacheModel cache = small_cache();
  const uint64_t stride = 8 * kLine;
  for (uint64_t i = 0; i < 4; ++i) cache.touch(i * stride, 1, false, 0);
  cache.touch(0, 1, false, 0);           // now 1 is the oldest
  cache.touch(4 * stride, 1, false, 0);  // which leaves
  cache.touch(0, 1, false, 0);
  EXPECT_EQ(cache.counts().fills, 5u);
  cache.touch(stride, 1, false, 0);
  EXPECT_EQ(cache.counts().fills, 6u);
}

TEST(CacheModel, AStrideOfAllSetsUsesOneSet) {
  CacheModel cache({.levels = {{.bytes = 2u << 20, .ways = 16}}});
  for (int round = 0; round < 2; ++round) {
    for (uint64_t i = 0; i < 17; ++i) cache.touch(i * 2048 * kLine, 1, false, 0);
  }
  EXPECT_EQ(cache.counts().fills, 34u);
}

TEST(CacheModel, WritesBackAWrittenLineOnceItLeaves) {
  CacheModel cache = small_cache();
  const uint64_t stride = 8 * kLine;
  for (int again = 0; again < 3; ++again) cache.touch(0, 8, true, 0);
  for (uint64_t i = 1; i <= 3; ++i) cache.touch(i * stride, 8, false, 0);
  EXPECT_EQ(cache.counts().write_backs, 0u);
  cache.touch(4 * stride, 8, false, 0);
  EXPECT_EQ(cache.counts().write_backs, 1u);
  cache.touch(0, 8, false, 0);  // comes back clean
  cache.flush();
  EXPECT_EQ(cache.counts().write_backs, 1u);
  EXPECT_EQ(cache.counts().fills, 6u);
}

TEST(CacheModel, AStreamOfWritesIsFetchedAndWrittenBack) {
  CacheModel cache = small_cache();
  for (uint64_t at = 0; at < 1 << 16; at += 4) cache.touch(at, 4, true, 0);
  cache.flush();
  EXPECT_EQ(cache.counts().fills, 1024u);
  EXPECT_EQ(cache.counts().write_backs, 1024u);
}

TEST(CacheModel, AWriteAfterAReadOfTheSameLineMakesItDirty) {
  CacheModel cache = small_cache();
  cache.touch(0, 4, false, 0);
  cache.touch(4, 4, true, 0);
  cache.flush();
  EXPECT_EQ(cache.counts().write_backs, 1u);
}

TEST(CacheModel, CountsFillsForWhoReadsAndWriteBacksForWhoWroteLast) {
  CacheModel cache = small_cache();
  cache.touch(0, 4, false, 1);
  cache.touch(64, 4, false, 1);
  cache.touch(0, 4, true, 2);
  cache.flush();
  EXPECT_EQ(cache.counts(1).fills, 2u);
  EXPECT_EQ(cache.counts(1).write_backs, 0u);
  EXPECT_EQ(cache.counts(2).fills, 0u);
  EXPECT_EQ(cache.counts(2).write_backs, 1u);
}

TEST(CacheModel, AnInnerCacheHidesItsHitsFromTheOrderOfTheOuter) {
  const CacheShape outer{.bytes = 4 * kLine, .ways = 4}, inner{.bytes = 2 * kLine, .ways = 2};
  CacheModel alone({.levels = {outer}}), behind({.levels = {inner, outer}});
  const auto touch = [&](uint64_t line) {
    for (CacheModel* cache : {&alone, &behind}) cache->touch(line * kLine, 1, false, 0);
  };
  for (const uint64_t line : {9, 1, 9, 2, 9, 3, 9, 4}) touch(line);  // 9 stays in the inner cache
  EXPECT_EQ(alone.counts().fills, 5u);
  EXPECT_EQ(behind.counts().fills, 5u);
  for (const uint64_t line : {5, 6, 9}) touch(line);  // 9 left the outer one long ago, and now the inner one
  EXPECT_EQ(alone.counts().fills, 7u);
  EXPECT_EQ(behind.counts().fills, 8u);
}

TEST(CacheModel, WhatTheInnerCacheLetsGoIsNotFetched) {
  const CacheShape outer{.bytes = 2 * kLine, .ways = 2}, inner{.bytes = 2 * kLine, .ways = 2};
  CacheModel cache({.levels = {inner, outer}});
  cache.touch(0, 8, true, 0);
  for (const uint64_t line : {1, 0, 2, 0, 3, 0}) cache.touch(line * kLine, 8, false, 0);
  EXPECT_EQ(cache.counts().fills, 4u);  // line 0 has left the outer cache, not the inner one
  cache.flush();
  EXPECT_EQ(cache.counts().fills, 4u);
  EXPECT_EQ(cache.counts().write_backs, 1u);
}

/// The definition, written as slowly as it is simple.
class PlainCache {
 public:
  explicit PlainCache(const CacheShape& shape) : shape_(shape) {}
  void touch(uint64_t line, bool write) {
    std::list<uint64_t>& set = sets_[line % shape_.sets()];
    const auto found = std::find(set.begin(), set.end(), line);
    if (found != set.end()) {
      set.erase(found);
    } else {
      ++fills;
      if (set.size() == shape_.ways) {
        write_backs += dirty_[set.back()] ? 1 : 0;
        dirty_[set.back()] = false;
        set.pop_back();
      }
    }
    set.push_front(line);
    if (write) dirty_[line] = true;
  }
  uint64_t fills = 0, write_backs = 0;

 private:
  CacheShape shape_;
  std::map<uint64_t, std::list<uint64_t>> sets_;
  std::map<uint64_t, bool> dirty_;
};

TEST(CacheModel, AgreesWithItsDefinitionOnRandomTouches) {
  const CacheShape shape{.bytes = 16384, .ways = 4};
  CacheModel cache({.levels = {shape}});
  PlainCache plain(shape);
  std::mt19937_64 random(3);
  for (int i = 0; i < 200'000; ++i) {
    const uint64_t line = random() % (random() % 2 == 0 ? 128 : 2048);
    const bool write = random() % 3 == 0;
    cache.touch(line * kLine + random() % 8 * 8, 8, write, 0);
    plain.touch(line, write);
  }
  EXPECT_EQ(cache.counts().fills, plain.fills);
  EXPECT_EQ(cache.counts().write_backs, plain.write_backs);
}

TEST(CacheModel, ASampleOfSetsSaysNearlyWhatAllSetsSay) {
  CacheModel::Options options{.levels = {{.bytes = 16384, .ways = 4}, {.bytes = 256u << 10, .ways = 16}}};
  CacheModel all(options);
  options.one_in = 8;
  CacheModel some(options);
  std::mt19937_64 random(4);
  for (int i = 0; i < 300'000; ++i) {
    const uint64_t record = random() % (random() % 2 == 0 ? 512 : 8192);  // of 256 bytes: four lines
    const bool write = random() % 3 == 0;
    for (CacheModel* cache : {&all, &some}) cache->touch(record * 256 + 64, 100, write, 0);
  }
  const auto expect_near = [](uint64_t found, uint64_t wanted) {
    EXPECT_NEAR(static_cast<double>(found), static_cast<double>(wanted), 0.04 * static_cast<double>(wanted));
  };
  expect_near(some.counts().fills, all.counts().fills);
  expect_near(some.counts().write_backs, all.counts().write_backs);
}

TEST(CacheModel, SetsNeedNotBeAPowerOfTwo) {
  const CacheShape shape{.bytes = 12 * 5 * kLine, .ways = 5};  // 12 sets
  CacheModel cache({.levels = {shape}});
  PlainCache plain(shape);
  std::mt19937_64 random(5);
  for (int i = 0; i < 50'000; ++i) {
    const uint64_t line = random() % 150;
    cache.touch(line * kLine, 8, false, 0);
    plain.touch(line, false);
  }
  EXPECT_EQ(cache.counts().fills, plain.fills);
}

TEST(CacheModel, CountsWhatEachLevelIsAskedForAndLacks) {
  CacheModel cache({.levels = {{.bytes = 2 * kLine, .ways = 2}, {.bytes = 8 * kLine, .ways = 8}}});
  for (int round = 0; round < 2; ++round) {
    for (uint64_t line = 0; line < 4; ++line) cache.touch(line * kLine, 8, line == 0, 0);
    cache.touch(3 * kLine, 8, false, 0);
  }
  EXPECT_EQ(cache.level(0).accesses, 10u);
  EXPECT_EQ(cache.level(0).misses, 8u);  // but for the two lines touched again at once
  EXPECT_EQ(cache.level(0).write_backs, 2u);
  EXPECT_EQ(cache.level(1).accesses, 8u);
  EXPECT_EQ(cache.level(1).misses, 4u);
  EXPECT_EQ(cache.counts().fills, 4u);
  cache.flush();
  EXPECT_EQ(cache.counts().write_backs, 1u);
}

TEST(CacheModel, ThreadsBehindASharedLastLevelFindWhatOthersBrought) {
  const CacheShape shapes[] = {{.bytes = 2 * kLine, .ways = 2}, {.bytes = 64 * kLine, .ways = 8}};
  const SetSample sample = SetSample::of(shapes, 1);
  SharedCache last(shapes[1], sample);
  CacheModel first({shapes, 1}, sample, &last), second({shapes, 1}, sample, &last);
  for (CacheModel* cache : {&first, &second}) {
    for (uint64_t line = 0; line < 16; ++line) cache->touch(line * kLine, 8, false, 0);
    cache->flush();
    EXPECT_EQ(cache->level(0).misses, 16u);
  }
  EXPECT_EQ(last.model().level(0).accesses, 32u);
  EXPECT_EQ(last.model().level(0).misses, 16u);
  EXPECT_EQ(last.model().counts().fills, 16u);
}

TEST(CacheModel, RefusesShapesItCannotModel) {
  const CacheShape inner{.bytes = 48u << 10, .ways = 12};  // 64 sets
  EXPECT_TRUE(inner.check().ok());
  EXPECT_TRUE((CacheShape{.bytes = 105u << 20, .ways = 15}.check().ok()));
  EXPECT_FALSE((CacheShape{.bytes = (3u << 20) + 64, .ways = 16}.check().ok()));
  EXPECT_FALSE((CacheShape{.bytes = 2u << 20, .ways = 0}.check().ok()));
  EXPECT_FALSE((CacheShape{.bytes = 0, .ways = 16}.check().ok()));
  EXPECT_FALSE((CacheShape{.bytes = 3072, .ways = 16, .line_bytes = 48}.check().ok()));
  EXPECT_FALSE((CacheModel::Options{.levels = {}}.check().ok()));
  EXPECT_FALSE((CacheModel::Options{.levels = {{}, {.line_bytes = 128}}}.check().ok()));
  EXPECT_FALSE((CacheModel::Options{.levels = {{}}, .one_in = 3}.check().ok()));
  EXPECT_TRUE((CacheModel::Options{.levels = {inner, {}}, .one_in = 64}.check().ok()));
  EXPECT_FALSE((CacheModel::Options{.levels = {inner, {}}, .one_in = 128}.check().ok()));
}

}  // namespace
}  // namespace shoal
