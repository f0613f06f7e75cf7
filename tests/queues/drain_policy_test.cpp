#include "queues/drain_policy.h"

#include <gtest/gtest.h>

namespace shoal {
namespace {

/// waiting[i] rays wait for treelet i; resident[i] (default: none is) says whether it is in memory.
std::vector<WaitingTreelet> work(const std::vector<uint32_t>& waiting, const std::vector<bool>& resident = {}) {
  std::vector<WaitingTreelet> list;
  for (TreeletId id = 0; id < waiting.size(); ++id) {
    if (waiting[id] > 0) list.push_back({id, waiting[id], id < resident.size() && resident[id]});
  }
  return list;
}

using Ids = std::vector<TreeletId>;

Decision decide(DrainPolicy& policy, const std::vector<WaitingTreelet>& list, bool more_coming = true) {
  Decision decision;
  policy.decide(list, more_coming, decision);
  return decision;
}

constexpr PolicyOptions kSynchronous{.drains = 1, .loads = 0};

TEST(DrainPolicy, EveryNamedPolicyDrainsWorkWhenNoMoreIsComingAndNothingCanBeReadAhead) {
  for (const std::string_view name : drain_policy_names()) {
    const auto policy = make_drain_policy(name, kSynchronous);
    ASSERT_NE(policy, nullptr) << name;
    EXPECT_EQ(decide(*policy, work({0, 0, 3, 0}), false).drain, Ids{2}) << name;
    EXPECT_TRUE(decide(*policy, {}, false).drain.empty()) << name;
  }
  EXPECT_EQ(make_drain_policy("best", {}), nullptr);
}

TEST(DrainPolicy, EveryNamedPolicyDrainsOrLoadsWorkWhenReadingAhead) {
  for (const std::string_view name : drain_policy_names()) {
    const auto policy = make_drain_policy(name, {.rays_ahead = 1000});
    const Decision decision = decide(*policy, work({0, 0, 3, 0}), false);
    EXPECT_FALSE(decision.drain.empty() && decision.load.empty()) << name;
    EXPECT_EQ(decision.load, Ids{2}) << name;
    EXPECT_GT(decision.load_below_rays, 0u) << name;
  }
}

TEST(DrainPolicy, LimitsOfZeroStillFindTheWork) {
  const PolicyOptions none{.queue_capacity = 0, .minimum_batch = 0, .drains = 0, .loads = 0, .rays_ahead = 0};
  for (const std::string_view name : drain_policy_names()) {
    EXPECT_EQ(decide(*make_drain_policy(name, none), work({0, 3}), false).drain, Ids{1}) << name;
    EXPECT_TRUE(decide(*make_drain_policy(name, none), {}, false).drain.empty()) << name;
  }
}

TEST(DrainPolicy, ADecisionHoldsNoMoreThanItsLimits) {
  const std::vector<uint32_t> waiting(100, 5000);
  const PolicyOptions limits{.queue_capacity = 100, .drains = 7, .loads = 9};
  for (const std::string_view name : drain_policy_names()) {
    const Decision decision = decide(*make_drain_policy(name, limits), work(waiting));
    EXPECT_LE(decision.drain.size(), 7u) << name;
    EXPECT_LE(decision.load.size(), 9u) << name;
    EXPECT_FALSE(decision.load.empty()) << name;
  }
}

TEST(DrainPolicy, WhatIsLoadedIsNeverResident) {
  const auto list = work({500, 400, 300, 200}, {false, true, false, true});
  for (const std::string_view name : drain_policy_names()) {
    for (const TreeletId id : decide(*make_drain_policy(name, {.queue_capacity = 100}), list).load) {
      EXPECT_TRUE(id == 0 || id == 2) << name;
    }
  }
}

TEST(DrainPolicy, FullestTakesTheLargestAndTheSmallestIdOfEquals) {
  EXPECT_EQ(decide(*make_fullest_policy({.drains = 3}), work({4, 9, 9, 2})).drain, (Ids{1, 2, 0}));
}

TEST(DrainPolicy, SweepVisitsTreeletsInStorageOrder) {
  const auto policy = make_sweep_policy({.drains = 2});
  const auto list = work({1, 0, 5, 2});
  EXPECT_EQ(decide(*policy, list).drain, (Ids{0, 2}));
  EXPECT_EQ(decide(*policy, list).drain, (Ids{3, 0}));
  EXPECT_EQ(decide(*policy, list).drain, (Ids{2, 3}));
}

TEST(DrainPolicy, SweepTakesATreeletOnceADecision) {
  EXPECT_EQ(decide(*make_sweep_policy({.drains = 32}), work({3, 3, 3})).drain, (Ids{0, 1, 2}));
}

TEST(DrainPolicy, ResidentFirstPrefersMemoryUnlessItsBatchIsSmall) {
  const auto policy = make_resident_first_policy({.minimum_batch = 64, .drains = 1, .loads = 0});
  EXPECT_EQ(decide(*policy, work({500, 70, 80}, {false, true, true})).drain, Ids{2});
  EXPECT_EQ(decide(*policy, work({500, 10, 20}, {false, true, true})).drain, Ids{0});
  EXPECT_EQ(decide(*policy, work({5, 10, 20}, {false, true, true})).drain, Ids{2});
}

TEST(DrainPolicy, ResidentFirstReadsAheadWhatMostWaitForAndDrainsSmallBatchesMeanwhile) {
  const auto policy = make_resident_first_policy({.minimum_batch = 64, .loads = 2, .rays_ahead = 1000});
  const Decision decision = decide(*policy, work({500, 4, 26, 600, 400}, {false, true, true}));
  EXPECT_EQ(decision.drain, Ids{2});  // the larger of the small ones: what it sends on may fill the other
  EXPECT_EQ(decision.load, (Ids{3, 0}));
  EXPECT_EQ(decision.rays_in_memory, 30u);
  EXPECT_EQ(decision.load_below_rays, 1000u);
}

TEST(DrainPolicy, ResidentFirstDrainsAllBatchesOfLikeSizeInOneDecisionWhenAllAreSmall) {
  const auto policy = make_resident_first_policy({.minimum_batch = 64});
  EXPECT_EQ(decide(*policy, work({20, 30, 8, 6}, {true, true, true, true})).drain, (Ids{1, 0, 2}));
  EXPECT_EQ(decide(*policy, work({1, 1, 1}, {true, true, true})).drain, (Ids{0, 1, 2}));
  EXPECT_EQ(decide(*policy, work({4000, 70, 60}, {true, true, true})).drain, (Ids{0, 1}));
}

TEST(DrainPolicy, FullWaitsForCapacityWhileRaysAreComing) {
  const auto policy = make_full_policy({.queue_capacity = 100});
  EXPECT_TRUE(decide(*policy, work({99, 0, 50})).drain.empty());
  EXPECT_EQ(decide(*policy, work({99, 100, 50})).drain, Ids{1});
  EXPECT_EQ(decide(*policy, work({20, 0, 50}), false).drain, Ids{2});
}

TEST(DrainPolicy, FullNeverChoosesAnEmptyQueueWhateverItsCapacity) {
  const auto policy = make_full_policy({.queue_capacity = 0});
  EXPECT_EQ(decide(*policy, work({0, 0, 1})).drain, Ids{2});
  EXPECT_TRUE(decide(*policy, {}).drain.empty());
}

}  // namespace
}  // namespace shoal
