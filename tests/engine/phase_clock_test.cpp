#include "engine/phase_clock.h"

#include <gtest/gtest.h>

#include <vector>

namespace shoal {
namespace {

TEST(PhaseClock, GivesEveryTickToThePhaseItIsIn) {
  PhaseClock clock(100);
  clock.enter_at(Phase::kTraversal, 130);  // 30 of setup
  clock.enter_at(Phase::kShading, 180);    // 50 of traversal
  clock.enter_at(Phase::kTraversal, 187);  // 7 of shading
  clock.enter_at(Phase::kTraversal, 190);  // 3 of traversal: the same phase again
  clock.settle(200);                       // 10 of traversal
  EXPECT_EQ(clock.ticks(Phase::kSetup), 30u);
  EXPECT_EQ(clock.ticks(Phase::kTraversal), 63u);
  EXPECT_EQ(clock.ticks(Phase::kShading), 7u);
  uint64_t sum = 0;
  for (size_t i = 0; i < kPhaseCount; ++i) sum += clock.ticks(static_cast<Phase>(i));
  EXPECT_EQ(sum, 100u);
}

TEST(PhaseClock, TimeThatRunsBackwardsIsNone) {
  PhaseClock clock(100);
  clock.enter_at(Phase::kQueue, 90);  // another core, a little behind
  clock.enter_at(Phase::kPaths, 110);
  clock.settle(105);
  EXPECT_EQ(clock.ticks(Phase::kSetup), 0u);
  EXPECT_EQ(clock.ticks(Phase::kQueue), 10u);
  EXPECT_EQ(clock.ticks(Phase::kPaths), 0u);
}

TEST(PhaseClock, GivesAwayWhatWasAnotherPhasesAndNoMoreThanThereIs) {
  PhaseClock clock(0);
  clock.enter_at(Phase::kShading, 0);
  clock.give_to(Phase::kPaging, 40, 100);
  EXPECT_EQ(clock.ticks(Phase::kShading), 60u);
  EXPECT_EQ(clock.ticks(Phase::kPaging), 40u);
  clock.give_to(Phase::kPaging, 80, 110);
  clock.settle(115);  // still shading
  EXPECT_EQ(clock.ticks(Phase::kShading), 5u);
  EXPECT_EQ(clock.ticks(Phase::kPaging), 110u);
}

TEST(PhaseClock, ReadsTheTicksOfTheMachineOnlyToLeaveAPhase) {
  const uint64_t before = now_ticks();
  PhaseClock clock(before);
  clock.enter(Phase::kSetup);
  EXPECT_EQ(clock.ticks(Phase::kSetup), 0u) << "it is in this phase already";
  while (now_ticks() == before) {
  }
  clock.enter(Phase::kQueue);
  const uint64_t after = now_ticks();
  EXPECT_GT(clock.ticks(Phase::kSetup), 0u);
  EXPECT_LE(clock.ticks(Phase::kSetup), after - before);
}

TEST(PhaseTimes, AddUpTheThreadsAndKnowShares) {
  std::vector<PhaseClock> clocks(2, PhaseClock(0));
  clocks[0].enter_at(Phase::kTopTree, 0);
  clocks[0].enter_at(Phase::kQueue, 10);
  clocks[0].settle(40);
  clocks[1].enter_at(Phase::kQueue, 0);
  clocks[1].enter_at(Phase::kIdle, 20);
  clocks[1].settle(40);
  const PhaseTimes times = phase_times(clocks, 0.5);
  EXPECT_DOUBLE_EQ(times.of(Phase::kTopTree), 5);
  EXPECT_DOUBLE_EQ(times.of(Phase::kQueue), 25);
  EXPECT_DOUBLE_EQ(times.of(Phase::kIdle), 10);
  EXPECT_DOUBLE_EQ(times.total(), 40);
  EXPECT_DOUBLE_EQ(times.share(Phase::kQueue), 25.0 / 40);
  EXPECT_DOUBLE_EQ(times.routing_share(), 30.0 / 40);
  EXPECT_EQ(PhaseTimes{}.share(Phase::kQueue), 0) << "of no time";
}

}  // namespace
}  // namespace shoal
