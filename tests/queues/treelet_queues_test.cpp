#include "queues/treelet_queues.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <thread>
#include <vector>

#include "tests/queues/numbered_rays.h"

namespace shoal {
namespace {

using testing::drain;
using testing::numbered_ray;

TEST(TreeletQueues, GivesBackEveryRayOnceFromTheQueueItWasPushedTo) {
  TreeletQueues queues(3, 500, 1);
  for (uint32_t i = 0; i < 900; ++i) queues.push(i % 3, numbered_ray(i));
  for (uint32_t treelet = 0; treelet < 3; ++treelet) {
    EXPECT_EQ(queues.waiting(treelet), 300u);
    const std::vector<uint32_t> numbers = drain(queues, treelet);
    ASSERT_EQ(numbers.size(), 300u);
    for (uint32_t i = 0; i < 300; ++i) EXPECT_EQ(numbers[i], i * 3 + treelet);
    EXPECT_EQ(queues.waiting(treelet), 0u);
    EXPECT_TRUE(drain(queues, treelet).empty());
  }
}

TEST(TreeletQueues, HoldTwoRaysAPathWhereverTheyWait) {
  // The worst spread for the pool: every ray alone in its queue, then all rays in one queue, and back.
  constexpr uint32_t kPaths = 100, kTreelets = 1000;
  TreeletQueues queues(kTreelets, kPaths, 1);
  for (int round = 0; round < 3; ++round) {
    for (uint32_t i = 0; i < 2 * kPaths; ++i) queues.push(i * 5, numbered_ray(i));
    for (uint32_t i = 0; i < 2 * kPaths; ++i) {
      RayBatch batch = queues.take(i * 5);
      RayBlock block;
      ASSERT_EQ(batch.next_block(block), 1u);
      queues.push(7, block.rays[0]);
    }
    EXPECT_EQ(drain(queues, 7).size(), 2 * kPaths);
  }
  EXPECT_LE(queues.peak_blocks_count(), TreeletQueues::blocks_needed(kTreelets, kPaths, 1));
}

TEST(TreeletQueues, HandingRaysOnWhileDrainingNeverRunsOutOfBlocks) {
  constexpr uint32_t kPaths = 32;  // one block of rays
  TreeletQueues queues(64, kPaths, 1);
  for (uint32_t i = 0; i < 2 * kPaths; ++i) queues.push(0, numbered_ray(i));
  for (uint32_t round = 0; round < 200; ++round) {
    const TreeletId from = round % 2 == 0 ? 0 : 1 + (round / 2) % 63;
    RayBatch batch = queues.take(from);
    RayBlock block;
    while (const uint32_t count = batch.next_block(block)) {
      for (uint32_t i = 0; i < count; ++i) queues.push((block.rays[i].path * 31 + round) % 64, block.rays[i]);
    }
  }
  size_t left = 0;
  for (TreeletId id = 0; id < 64; ++id) left += drain(queues, id).size();
  EXPECT_EQ(left, 2 * kPaths);
}

TEST(TreeletQueues, LoseNoRayWhenManyThreadsPushAndDrain) {
  constexpr uint32_t kThreads = 4, kPaths = 4000, kTreelets = 37;
  TreeletQueues queues(kTreelets, kPaths, kThreads);
  std::atomic<uint64_t> sum{0};
  std::atomic<uint32_t> finished{0};
  std::vector<std::thread> threads;
  for (uint32_t t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      for (uint32_t i = t; i < 2 * kPaths; i += kThreads) queues.push(i % kTreelets, numbered_ray(i));
      RayBlock block;
      for (uint32_t turn = t; finished < 2 * kPaths; ++turn) {
        RayBatch batch = queues.take(turn % kTreelets);
        while (const uint32_t count = batch.next_block(block)) {
          for (uint32_t i = 0; i < count; ++i) {
            if (++block.rays[i].hit.primitive < 5) {
              queues.push((block.rays[i].path + turn) % kTreelets, block.rays[i]);
            } else {
              sum += block.rays[i].path;
              ++finished;
            }
          }
        }
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(finished, 2 * kPaths);
  EXPECT_EQ(sum, uint64_t{2 * kPaths} * (2 * kPaths - 1) / 2);
}

}  // namespace
}  // namespace shoal
