#include "engine/choose_order.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace shoal {
namespace {

using ::testing::HasSubstr;

MemoryPlan plan_with(uint64_t cache_bytes, uint32_t paths) {
  MemoryPlan plan;
  plan.geometry_page_bytes = 1000;
  plan.cache_bytes = cache_bytes;
  plan.paths_in_flight = paths;
  plan.every_order_fits = true;
  return plan;
}

TEST(ChooseOrder, TakesWhatWasAskedFor) {
  for (const Order order : {Order::kQueued, Order::kDepthFirst, Order::kSorted, Order::kHybrid}) {
    const FirstChoice choice = choose_before_trials(order, plan_with(1000, 1), 1ull << 40);
    EXPECT_EQ(choice.chosen.order, order);
    EXPECT_FALSE(choice.to_be_tried);
  }
}

TEST(ChooseOrder, TriesNothingWherePagesDoNotFit) {
  const FirstChoice choice = choose_before_trials(Order::kAuto, plan_with(999, 1), 1ull << 40);
  EXPECT_EQ(choice.chosen.order, Order::kQueued);
  EXPECT_FALSE(choice.to_be_tried);
  EXPECT_THAT(choice.chosen.reason, HasSubstr("cache"));
}

TEST(ChooseOrder, TriesNothingThatHasNoRoom) {
  MemoryPlan plan = plan_with(1000, 1);
  plan.every_order_fits = false;
  const FirstChoice choice = choose_before_trials(Order::kAuto, plan, 1ull << 40);
  EXPECT_EQ(choice.chosen.order, Order::kQueued);
  EXPECT_FALSE(choice.to_be_tried);
  EXPECT_THAT(choice.chosen.reason, HasSubstr("memory"));
}

TEST(ChooseOrder, TriesNothingInAShortRender) {
  const MemoryPlan plan = plan_with(1000, 1u << 19);
  EXPECT_EQ(trial_samples(plan), 1u << 20);
  EXPECT_FALSE(choose_before_trials(Order::kAuto, plan, (1u << 24) - 1).to_be_tried);
  EXPECT_EQ(choose_before_trials(Order::kAuto, plan, (1u << 24) - 1).chosen.order, Order::kHybrid);
  MemoryPlan large = plan;
  large.geometry_page_bytes = large.cache_bytes = 1u << 30;
  EXPECT_EQ(choose_before_trials(Order::kAuto, large, (1u << 24) - 1).chosen.order, Order::kQueued);
  EXPECT_TRUE(choose_before_trials(Order::kAuto, plan, 1u << 24).to_be_tried);
  EXPECT_FALSE(choose_before_trials(Order::kAuto, plan_with(1000, 32), 1u << 19).to_be_tried)
      << "few paths in flight do not make short trials say anything";
}

TEST(ChooseOrder, GoesOnWithTheFastestAndSaysWhatItSaw) {
  const OrderTrial trials[] = {{Order::kDepthFirst, 3, 1000000000}, {Order::kSorted, 4, 2000000000},
                               {Order::kQueued, 3, 1000000000}};
  const ChosenOrder chosen = choose_by_trials(trials);
  EXPECT_EQ(chosen.order, Order::kSorted);
  EXPECT_THAT(chosen.reason, HasSubstr("depth-first 3.00, sorted 2.00, queued 3.00"));
}

TEST(ChooseOrder, StaysWithTheQueuedOrderWhenAnotherIsHardlyFaster) {
  const OrderTrial trials[] = {{Order::kDepthFirst, 0.98, 1000}, {Order::kQueued, 1, 1000}};
  EXPECT_EQ(choose_by_trials(trials).order, Order::kQueued);
  const OrderTrial faster[] = {{Order::kDepthFirst, 0.9, 1000}, {Order::kQueued, 1, 1000}};
  EXPECT_EQ(choose_by_trials(faster).order, Order::kDepthFirst);
}

}  // namespace
}  // namespace shoal
