#include "engine/accuracy.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

#include "engine/accuracy_plan.h"
#include "engine/accuracy_report.h"
#include "engine/pareto_front.h"
#include "tests/engine/built_scene.h"
#include "tests/support/white_box.h"

namespace shoal::testing {
namespace {

/// The white box under a white sky, small.
class Accuracy : public ::testing::Test {
 protected:
  Accuracy() {
    white_box().save(files_);
    built_ = build_and_open(files_);
    EnvironmentOptions& sky = job_.base.picture.shading.environment;
    sky.kind = EnvironmentOptions::Kind::kConstant, sky.radiance = Vec3(1);
    job_.sizes = {32, 24, 4, 256};
    job_.knobs = {"samples", "bounces", "roulette"};
    job_.execution.threads = 2;
  }
  Result<AccuracyResult> measured() { return measure_accuracy(files_, built_.scene, job_, hooks_); }
  AccuracyResult measure() {
    Result<AccuracyResult> result = measured();
    EXPECT_TRUE(result.ok()) << result.error().message;
    return std::move(result).value();
  }

  MemoryFileSystem files_;
  BuiltScene built_;
  AccuracyJob job_;
  AccuracyHooks hooks_;
};

TEST_F(Accuracy, FindsTheBiasOfFewBouncesAndNoneOfRoulette) {
  job_.base.picture.shading.bounces = 32;
  const AccuracyResult result = measure();
  ASSERT_TRUE(result.base().base);
  const AccuracyRow* few = result.find("bounces", "1");
  ASSERT_NE(few, nullptr);
  EXPECT_TRUE(few->error.biased);
  EXPECT_GT(few->bias(), 0.3);
  EXPECT_GT(few->flip, result.base().flip);
  for (const char* value : {"1", "off"}) {
    const AccuracyRow* roulette = result.find("roulette", value);
    ASSERT_NE(roulette, nullptr);
    EXPECT_FALSE(roulette->error.biased) << value;
  }
  EXPECT_GT(result.find("roulette", "1")->error.variance.value, result.find("roulette", "off")->error.variance.value);
}

TEST_F(Accuracy, FindsTheBiasOfALimitToLightAndNoneOfSamplers) {
  job_.base.picture.shading.bounces = 32;
  job_.base.picture.shading.environment.radiance = Vec3(4);
  job_.knobs = {"clamp-indirect", "sampler"};
  const AccuracyResult result = measure();
  const AccuracyRow *low = result.find("clamp-indirect", "1"), *high = result.find("clamp-indirect", "10");
  ASSERT_TRUE(low != nullptr && high != nullptr);
  EXPECT_TRUE(low->error.biased);
  EXPECT_GT(low->bias(), 0.05);
  EXPECT_FALSE(high->error.biased) << "no light here is brighter than the sky";
  for (const char* kind : {"independent", "blue-noise"}) {
    const AccuracyRow* sampler = result.find("sampler", kind);
    ASSERT_NE(sampler, nullptr) << kind;
    EXPECT_FALSE(sampler->error.biased) << kind;
  }
}

TEST_F(Accuracy, VarianceFallsWithTheNumberOfIndependentSamples) {
  job_.base.picture.shading.bounces = 32;
  job_.base.picture.shading.sampler = SamplerKind::kIndependent;
  const AccuracyResult result = measure();
  const AccuracyRow *one = result.find("samples", "1"), *many = result.find("samples", "16");
  ASSERT_TRUE(one != nullptr && many != nullptr);
  EXPECT_NEAR(one->error.variance.value / many->error.variance.value, 16, 5);
  EXPECT_LT(many->rel_mse, one->rel_mse);
  EXPECT_LT(many->flip, one->flip);
  EXPECT_FALSE(one->error.biased);
}

TEST_F(Accuracy, RowsAreWhatTheirColumnsSay) {
  const AccuracyResult result = measure();
  std::vector<PricedError> choices;
  for (const AccuracyRow& row : result.rows) choices.push_back({row.seconds, row.rel_mse});
  const std::vector<bool> front = pareto_front(choices);
  for (size_t i = 0; i < result.rows.size(); ++i) {
    const AccuracyRow& row = result.rows[i];
    EXPECT_EQ(row.pareto, front[i]) << row.name;
    EXPECT_EQ(row.settings.size(), result.knobs.size()) << row.name;
    EXPECT_LE(row.seconds_min, row.seconds);
    EXPECT_LE(row.seconds, row.seconds_max);
    EXPECT_GT(row.machine_pace, 0) << row.name;
    EXPECT_LE(row.rel_mse_min, row.rel_mse);
    EXPECT_LE(row.rel_mse, row.rel_mse_max);
    EXPECT_LE(row.rel_mse, row.rel_mse_all) << "the trimmed mean leaves the largest out";
    EXPECT_LE(row.error.variance.low, row.error.variance.high);
    EXPECT_LE(row.efficiency.low, row.efficiency.value);
    EXPECT_LE(row.efficiency.value, row.efficiency.high);
    EXPECT_NEAR(row.efficiency.value * row.error.variance.value * row.seconds, 1, 1e-6) << row.name;
    EXPECT_DOUBLE_EQ(row.bytes_a_triangle * 10, static_cast<double>(row.file_bytes));
    EXPECT_EQ(std::to_string(row.samples), row.settings[0]);
  }
}

TEST_F(Accuracy, JsonAndCsvHoldTheSameRowsAndColumns) {
  const AccuracyResult result = measure();
  const auto json = nlohmann::json::parse(accuracy_json(result, built_.scene, job_));
  const std::vector<AccuracyColumn> columns = accuracy_columns();
  std::istringstream csv(accuracy_csv(result));
  std::string line, head;
  for (const AccuracyColumn& column : columns) head += column.name + ",";
  std::getline(csv, line);
  EXPECT_EQ(line, head + "knob:samples,knob:bounces,knob:roulette\r");
  ASSERT_EQ(json["rows"].size(), result.rows.size());
  for (const auto& row : json["rows"]) {
    std::getline(csv, line);
    EXPECT_TRUE(line.starts_with(row["name"].get<std::string>()) || line.starts_with("\"")) << line;
    for (const AccuracyColumn& column : columns) EXPECT_TRUE(row.contains(column.name)) << column.name;
    EXPECT_EQ(row["settings"].size(), 3u);
  }
  EXPECT_EQ(json["reference"]["samples_per_pixel"], 256);
  EXPECT_TRUE(json["reference"]["noise_known"]);
  EXPECT_GT(json["sentences"].size(), 4u);
}

TEST_F(Accuracy, AReferenceThatIsGivenIsComparedWith) {
  job_.reference = RgbPicture(32 * 24 * 3, 0.25f);
  job_.knobs = {"roulette"};
  const AccuracyResult result = measure();
  EXPECT_TRUE(result.reference_given);
  EXPECT_FALSE(result.reference_noise_known);
  EXPECT_TRUE(result.base().error.biased) << "the box is not grey";
  EXPECT_EQ(result.reference_seconds, 0);
}

TEST_F(Accuracy, TheSamePictureErrorsComeOfAnyOrderAndThreads) {
  job_.knobs = {"roulette"};
  const AccuracyResult first = measure();
  job_.execution.threads = 1, job_.execution.order = Order::kDepthFirst;
  const AccuracyResult second = measure();
  for (const AccuracyRow& row : first.rows) {
    if (row.knob == "together") continue;  // what is best for the time depends on the time
    const AccuracyRow* other = row.base ? &second.base() : second.find(row.knob, row.value);
    ASSERT_NE(other, nullptr);
    EXPECT_EQ(row.rel_mse, other->rel_mse);
    EXPECT_EQ(row.flip, other->flip);
    EXPECT_EQ(row.error.variance.value, other->error.variance.value);
  }
}

TEST_F(Accuracy, StopsWhenItIsAskedTo) {
  const std::atomic<bool> stop{true};
  hooks_.stop = &stop;
  const Result<AccuracyResult> result = measured();
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kStopped);
}

TEST_F(Accuracy, ABudgetThatIsTooSmallLowersSizesAndNamesWhatIsLeftOut) {
  job_.sizes = {300, 200, 16, 1024};
  job_.budget_seconds = 1e-3;
  const AccuracyResult result = measure();
  EXPECT_LT(result.sizes.width, 300u);
  EXPECT_EQ(std::min(result.sizes.width, result.sizes.height), kShortestSide);
  EXPECT_EQ(result.sizes.samples, 4u);
  EXPECT_FALSE(result.left_out.empty());
  EXPECT_EQ(result.rows.size(), 1u) << "the base is measured whatever it takes";
}

TEST_F(Accuracy, UnknownKnobsAreUsage) {
  job_.knobs = {"bounces", "shininess"};
  const Result<AccuracyResult> result = measured();
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kUsage);
  EXPECT_NE(result.error().message.find("'shininess': expected one of samples, sampler, bounces"), std::string::npos)
      << result.error().message;
}

TEST(AccuracyKnobs, EveryValueHoldsOnceItIsApplied) {
  AccuracySettings base;
  base.picture.samples = 12, base.picture.shading.bounces = 5;
  for (const AccuracyKnob& knob : accuracy_knobs(base)) {
    EXPECT_FALSE(knob.sentence.empty()) << knob.name;
    EXPECT_NE(knob.value_of(base), AccuracyKnob::kNoValue) << knob.name << ": the base is among its values";
    for (size_t i = 0; i < knob.values.size(); ++i) {
      AccuracySettings turned = base;
      knob.values[i].apply(turned);
      EXPECT_EQ(knob.value_of(turned), i) << knob.name;
    }
  }
}

TEST(AccuracyPlan, FitsTheBudgetByLoweringAndNeverRaises) {
  AccuracyJob job;
  job.sizes = {1024, 512, 16, 1024};
  const RenderPace pace{0.01, 1e-6};
  double last = 1e9;
  for (const double budget : {1e6, 1e4, 1e3, 100.0, 10.0}) {
    const AccuracySizes sizes = fit_budget(job, pace, budget, false);
    const double pixels = static_cast<double>(sizes.width) * sizes.height * sizes.samples;
    EXPECT_LE(pixels, last);
    EXPECT_LE(sizes.width, 1024u);
    EXPECT_LE(sizes.samples, 16u);
    EXPECT_LE(sizes.reference_samples, 1024u);
    EXPECT_NEAR(static_cast<double>(sizes.width) / sizes.height, 2, 0.05);
    last = pixels;
  }
  EXPECT_EQ(fit_budget(job, pace, 1e9, false).width, 1024u);
  EXPECT_EQ(fit_budget(job, pace, 1, true).width, 1024u) << "a given reference fixes the picture's size";
}

TEST(AccuracyPlan, PaceIsWhatTwoRendersSay) {
  const RenderPace pace = pace_of(100, 1, 0.3, 4, 0.6);
  EXPECT_NEAR(pace.seconds_a_sample, 0.001, 1e-9);
  EXPECT_NEAR(pace.seconds_a_render, 0.2, 1e-9);
  EXPECT_GT(pace_of(100, 1, 0.9, 4, 0.6).seconds_a_sample, 0) << "the shorter one was disturbed";
}

}  // namespace
}  // namespace shoal::testing
