#include "queues/ray_outbox.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include "tests/queues/numbered_rays.h"

namespace shoal {
namespace {

using testing::drain;
using testing::numbered_ray;

TEST(RayOutbox, BringsEveryRayOnceToTheQueueItWasSentTo) {
  constexpr uint32_t kTreelets = 200, kRays = 5000;
  TreeletQueues queues(kTreelets, kRays, 1);
  const auto outbox = std::make_unique<RayOutbox>(queues);
  // 64 apart share a buffer; a stride that is no multiple of it mixes them.
  for (uint32_t i = 0; i < kRays; ++i) outbox->push(i * 37 % kTreelets, numbered_ray(i));
  outbox->flush();
  for (TreeletId treelet = 0; treelet < kTreelets; ++treelet) {
    std::vector<uint32_t> sent;
    for (uint32_t i = 0; i < kRays; ++i) {
      if (i * 37 % kTreelets == treelet) sent.push_back(i);
    }
    EXPECT_EQ(queues.waiting(treelet), sent.size());
    EXPECT_EQ(drain(queues, treelet), sent) << treelet;
  }
}

TEST(RayOutbox, ShowsRaysWhenABufferIsFullWantedByAnotherTreeletOrFlushed) {
  TreeletQueues queues(100, 100, 1);
  const auto outbox = std::make_unique<RayOutbox>(queues);
  for (uint32_t i = 0; i < 7; ++i) outbox->push(3, numbered_ray(i));
  EXPECT_EQ(queues.waiting(3), 0u);
  outbox->push(3, numbered_ray(7));
  EXPECT_EQ(queues.waiting(3), 8u);
  outbox->push(3, numbered_ray(8));
  outbox->push(3 + 64, numbered_ray(9));
  EXPECT_EQ(queues.waiting(3), 9u);
  EXPECT_EQ(queues.waiting(3 + 64), 0u);
  outbox->flush();
  EXPECT_EQ(queues.waiting(3 + 64), 1u);
  outbox->flush();
  EXPECT_EQ(queues.waiting(3 + 64), 1u);
}

TEST(RayOutbox, ForgetsWhatItHoldsWhenCleared) {
  TreeletQueues queues(4, 10, 1);
  const auto outbox = std::make_unique<RayOutbox>(queues);
  outbox->push(1, numbered_ray(1));
  outbox->clear();
  outbox->push(2, numbered_ray(2));
  outbox->flush();
  EXPECT_EQ(queues.waiting(1), 0u);
  EXPECT_EQ(drain(queues, 2), std::vector<uint32_t>{2});
}

TEST(RayOutbox, RaysGoOnFromDrainToDrainInAsManyBlocksAsEver) {
  constexpr uint32_t kPaths = 32, kTreelets = 64;  // one block of rays
  TreeletQueues queues(kTreelets, kPaths, 1);
  const auto outbox = std::make_unique<RayOutbox>(queues);
  for (uint32_t i = 0; i < 2 * kPaths; ++i) outbox->push(0, numbered_ray(i));
  outbox->flush();
  for (uint32_t round = 0; round < 200; ++round) {
    RayBatch batch = queues.take(round % 2 == 0 ? 0 : 1 + (round / 2) % 63);
    RayBlock block;
    while (const uint32_t count = batch.next_block(block)) {
      for (uint32_t i = 0; i < count; ++i) {
        outbox->push((block.rays[i].path * 31 + round) % kTreelets, block.rays[i]);
      }
    }
    outbox->flush();
  }
  size_t left = 0;
  for (TreeletId id = 0; id < kTreelets; ++id) left += drain(queues, id).size();
  EXPECT_EQ(left, 2 * kPaths);
  EXPECT_LE(queues.peak_blocks_count(), TreeletQueues::blocks_needed(kTreelets, kPaths, 1));
}

TEST(RayOutbox, ThreadsWithOutboxesOfTheirOwnLoseNoRay) {
  constexpr uint32_t kRays = 20000, kTreelets = 150, kThreads = 2;
  TreeletQueues queues(kTreelets, kRays, 2 * kThreads);
  std::vector<std::atomic<int>> times(kRays);
  std::atomic<uint32_t> taken{0};
  std::vector<std::thread> threads;
  for (uint32_t t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      const auto outbox = std::make_unique<RayOutbox>(queues);
      for (uint32_t i = t; i < kRays; i += kThreads) outbox->push(i % kTreelets, numbered_ray(i));
      outbox->flush();
    });
    threads.emplace_back([&, t] {
      for (uint32_t turn = t; taken < kRays; ++turn) {
        for (const uint32_t number : drain(queues, turn % kTreelets)) ++times[number], ++taken;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (uint32_t i = 0; i < kRays; ++i) EXPECT_EQ(times[i], 1) << i;
}

}  // namespace
}  // namespace shoal
