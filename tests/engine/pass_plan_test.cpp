// Passes towards a time limit, with clocks that are made up: what they add up to, and what is foretold.
#include "engine/pass_plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

namespace shoal {
namespace {

/// Runs passes that take `seconds_of(pass, samples)`; returns when the last one ended.
double run(PassPlan& passes, const std::function<double(uint32_t, uint32_t)>& seconds_of) {
  double now = 0.5;  // reading tables
  uint32_t end = 0;
  for (SampleSpan span = passes.next(now); span.count() > 0; span = passes.next(now)) {
    EXPECT_EQ(span.begin, end) << "no sample is left out or taken twice";
    end = span.end;
    now += seconds_of(passes.passes_count(), span.count());
    if (passes.passes_count() > 100) {
      ADD_FAILURE() << "it does not end";
      break;
    }
  }
  EXPECT_EQ(passes.done(), end);
  return now;
}

TEST(PassPlan, IsOnePassOfAllSamplesWithoutALimit) {
  PassPlan passes(1000, 0);
  run(passes, [](uint32_t, uint32_t) { return 1e9; });
  EXPECT_EQ(passes.done(), 1000u);
  EXPECT_EQ(passes.passes_count(), 1u);
}

TEST(PassPlan, FillsTheTimeToOnePercentOrOneSample) {
  for (const double sample_seconds : {1e-5, 1e-3, 0.1, 0.7, 3.0, 11.0, 50.0}) {
    PassPlan passes(1u << 30, 60);
    const double end = run(passes, [&](uint32_t, uint32_t samples) { return samples * sample_seconds; });
    EXPECT_LE(end, 60 * 1.0001) << sample_seconds;
    EXPECT_GE(end, 60 - std::max(0.6, sample_seconds) - 1e-9) << sample_seconds;
    EXPECT_LE(passes.passes_count(), 20u) << sample_seconds;
  }
}

TEST(PassPlan, FillsTheTimeThoughPassesAreSlowToStartAndTheFirstReadsTheScene) {
  for (const double start : {0.001, 0.05, 0.5}) {
    PassPlan passes(1u << 22, 60);
    const double end = run(passes, [&](uint32_t pass, uint32_t samples) {
      return start + samples * 0.01 + (pass == 1 ? 5.0 : 0.0);
    });
    EXPECT_LE(end, 60.0) << start;
    EXPECT_GE(end, 60 - 0.6 - 0.01 - start) << start;
  }
}

TEST(PassPlan, FillsTheTimeThoughFewerPixelsAreDrawnFromPassToPass) {
  for (const double sample_seconds : {1e-6, 1e-5, 1e-4}) {  // of a pixel
    PassPlan passes(1u << 22, 60, true);
    uint64_t pixels = 262144;
    double now = 0.5;
    SampleSpan span = passes.next(now);
    passes.begins_with(pixels);
    for (; span.count() > 0; span = passes.next(now, pixels)) {
      now += sample_seconds * span.count() * static_cast<double>(pixels);
      pixels = std::max<uint64_t>(pixels * 3 / 4, 1024);
      ASSERT_LT(passes.passes_count(), 100u);
    }
    EXPECT_LT(now, 60 * 1.01) << sample_seconds;
    EXPECT_GT(now, 20) << sample_seconds << ": it ended early";
  }
}

TEST(PassPlan, OvershootsByPartOfThePassWhenTheMachineSlowsDown) {
  PassPlan passes(1u << 22, 60);
  double now = 0;
  double longest = 0;
  const double end = run(passes, [&](uint32_t, uint32_t samples) {
    const double taken = samples * (now < 30 ? 0.01 : 0.02);
    now += taken, longest = std::max(longest, taken);
    return taken;
  });
  EXPECT_LE(end, 60 + longest);
}

TEST(PassPlan, TakesOneSampleHoweverLateItIs) {
  PassPlan passes(16, 0.1);
  run(passes, [](uint32_t, uint32_t) { return 100.0; });
  EXPECT_EQ(passes.done(), 1u);
}

TEST(PassPlan, TakesNoMoreThanTheMost) {
  PassPlan passes(100, 60);
  run(passes, [](uint32_t, uint32_t) { return 0.0; });
  EXPECT_EQ(passes.done(), 100u);
}

TEST(Forecast, SaysNothingBeforeItHasSeenAnything) {
  Forecast forecast{1000, 0};
  forecast.mark(0, 3);
  EXPECT_FALSE(forecast.seconds_left(0, 4));
  EXPECT_EQ(forecast.fraction(0, 4), 0);
}

TEST(Forecast, CountsTheSpeedOfThisPassAndTheOneBefore) {
  Forecast forecast{1000, 0};
  forecast.mark(0, 3);  // setting up is not part of the speed
  EXPECT_DOUBLE_EQ(forecast.seconds_left(100, 13).value(), 90);
  EXPECT_DOUBLE_EQ(forecast.fraction(100, 13), 0.1);
  forecast.mark(100, 13);
  EXPECT_DOUBLE_EQ(forecast.seconds_left(100, 13).value(), 90);
  forecast.mark(400, 23);  // ten times as fast as the first
  EXPECT_DOUBLE_EQ(forecast.seconds_left(700, 33).value(), 10);
}

TEST(Forecast, IsNeverMoreThanTheTimeThatIsLeft) {
  Forecast forecast{1000000, 60};
  forecast.mark(0, 1);
  EXPECT_DOUBLE_EQ(forecast.seconds_left(0, 20).value(), 40);
  EXPECT_DOUBLE_EQ(forecast.seconds_left(500, 21).value(), 39);
  EXPECT_DOUBLE_EQ(forecast.seconds_left(999999, 21).value(), 20e-6 / 0.999999);
  EXPECT_DOUBLE_EQ(forecast.seconds_left(500, 70).value(), 0);
  EXPECT_DOUBLE_EQ(forecast.fraction(500, 30), 0.5);
  EXPECT_DOUBLE_EQ(forecast.fraction(500, 90), 1);
}

}  // namespace
}  // namespace shoal
