#include "queues/drain_policy.h"

#include <gtest/gtest.h>

namespace shoal {
namespace {

class FixedView final : public WaitingView {
 public:
  FixedView(std::vector<uint32_t> waiting, std::vector<bool> resident = {})
      : waiting_(std::move(waiting)), resident_(std::move(resident)) {
    resident_.resize(waiting_.size());
  }
  uint32_t treelet_count() const override { return static_cast<uint32_t>(waiting_.size()); }
  uint32_t waiting(TreeletId id) const override { return waiting_[id]; }
  bool resident(TreeletId id) const override { return resident_[id]; }

 private:
  std::vector<uint32_t> waiting_;
  std::vector<bool> resident_;
};

TEST(DrainPolicy, EveryNamedPolicyChoosesWorkWhenNoMoreIsComing) {
  for (const std::string_view name : drain_policy_names()) {
    const auto policy = make_drain_policy(name, {});
    ASSERT_NE(policy, nullptr) << name;
    EXPECT_EQ(policy->choose(FixedView({0, 0, 3, 0}), false), 2u) << name;
    EXPECT_EQ(policy->choose(FixedView({0, 0, 0, 0}), false), kNoIndex) << name;
    EXPECT_EQ(policy->choose(FixedView({}), false), kNoIndex) << name;
  }
  EXPECT_EQ(make_drain_policy("best", {}), nullptr);
}

TEST(DrainPolicy, LimitsOfZeroStillFindTheWork) {
  const PolicyOptions none{.queue_capacity = 0, .minimum_batch = 0};
  for (const std::string_view name : drain_policy_names()) {
    EXPECT_EQ(make_drain_policy(name, none)->choose(FixedView({0, 3}), false), 1u) << name;
    EXPECT_EQ(make_drain_policy(name, none)->choose(FixedView({0, 0}), false), kNoIndex) << name;
  }
}

TEST(DrainPolicy, FullestTakesTheLargestAndTheSmallestIdOfEquals) {
  EXPECT_EQ(make_fullest_policy()->choose(FixedView({4, 9, 9, 2}), true), 1u);
}

TEST(DrainPolicy, SweepVisitsTreeletsInStorageOrder) {
  const auto policy = make_sweep_policy();
  const FixedView view({1, 0, 5, 2});
  EXPECT_EQ(policy->choose(view, true), 0u);
  EXPECT_EQ(policy->choose(view, true), 2u);
  EXPECT_EQ(policy->choose(view, true), 3u);
  EXPECT_EQ(policy->choose(view, true), 0u);
}

TEST(DrainPolicy, ResidentFirstPrefersMemoryUnlessItsBatchIsSmall) {
  const auto policy = make_resident_first_policy(64);
  EXPECT_EQ(policy->choose(FixedView({500, 70, 80}, {false, true, true}), true), 2u);
  EXPECT_EQ(policy->choose(FixedView({500, 10, 20}, {false, true, true}), true), 0u);
  EXPECT_EQ(policy->choose(FixedView({5, 10, 20}, {false, true, true}), true), 2u);
}

TEST(DrainPolicy, FullWaitsForCapacityWhileRaysAreComing) {
  const auto policy = make_full_policy(100);
  EXPECT_EQ(policy->choose(FixedView({99, 0, 50}), true), kNoIndex);
  EXPECT_EQ(policy->choose(FixedView({99, 100, 50}), true), 1u);
  EXPECT_EQ(policy->choose(FixedView({20, 0, 50}), false), 2u);
}

TEST(DrainPolicy, FullNeverChoosesAnEmptyQueueWhateverItsCapacity) {
  const auto policy = make_full_policy(0);
  EXPECT_EQ(policy->choose(FixedView({0, 0, 1}), true), 2u);
  EXPECT_EQ(policy->choose(FixedView({0, 0, 0}), true), kNoIndex);
}

}  // namespace
}  // namespace shoal
