#include "queues/path_lists.h"

#include <gtest/gtest.h>

#include <set>
#include <thread>
#include <vector>

namespace shoal {
namespace {

TEST(PathLists, GiveBackWhatWasPushedAndAreEmptyAfter) {
  PathLists lists(2);
  uint32_t next[10];
  for (uint32_t path = 0; path < 10; ++path) lists.push(path % 2, path, next[path]);
  EXPECT_EQ(lists.waiting(0), 5u);
  std::set<uint32_t> seen;
  for (uint32_t path = lists.take(0); path != kNoIndex; path = next[path]) seen.insert(path);
  EXPECT_EQ(seen, (std::set<uint32_t>{0, 2, 4, 6, 8}));
  EXPECT_TRUE(lists.empty(0));
  EXPECT_EQ(lists.waiting(0), 0u);
  EXPECT_FALSE(lists.empty(1));
  EXPECT_EQ(lists.take(0), kNoIndex);
}

TEST(PathLists, LoseNothingBetweenThreads) {
  constexpr uint32_t kPaths = 20000;
  PathLists lists(3);
  std::vector<uint32_t> links(kPaths);
  std::atomic<uint32_t> taken{0};
  std::vector<std::atomic<int>> times(kPaths);
  std::vector<std::thread> threads;
  for (uint32_t t = 0; t < 2; ++t) {
    threads.emplace_back([&, t] {
      for (uint32_t path = t; path < kPaths; path += 2) lists.push(path % 3, path, links[path]);
    });
    threads.emplace_back([&] {
      for (uint32_t turn = 0; taken < kPaths; ++turn) {
        for (uint32_t path = lists.take(turn % 3); path != kNoIndex;) {
          const uint32_t next = links[path];
          ++times[path];
          ++taken;
          path = next;
        }
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (uint32_t path = 0; path < kPaths; ++path) EXPECT_EQ(times[path], 1) << path;
}

}  // namespace
}  // namespace shoal
