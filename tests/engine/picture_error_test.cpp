#include "engine/picture_error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "engine/pareto_front.h"

namespace shoal {
namespace {

constexpr uint32_t kSide = 48;
constexpr double kTruth = 0.5, kWeight = 1 / (kTruth * kTruth + 0.01);

/// kTruth + offset + noise everywhere.
std::vector<RgbPicture> noisy(uint32_t count, double offset, double deviation, uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> noise(static_cast<float>(kTruth + offset), static_cast<float>(deviation));
  std::vector<RgbPicture> pictures(count, RgbPicture(kSide * kSide * 3));
  for (RgbPicture& picture : pictures) {
    for (float& value : picture) value = deviation > 0 ? noise(random) : static_cast<float>(kTruth + offset);
  }
  return pictures;
}

NoiseAndBias found(const std::vector<RgbPicture>& pictures, std::vector<RgbPicture> reference) {
  return noise_and_bias(kSide, kSide, pictures, reference_of(kSide, kSide, std::move(reference)));
}

TEST(PictureError, IsTheMeanOfTheDefinition) {
  const RgbPicture reference = {1, 1, 1, 0, 0, 0}, picture = {2, 1, 1, 0.1f, 0, 0};
  const RelativeError error = relative_error(picture, reference);
  EXPECT_NEAR(error.all, (1 / 1.01 + 0.01 / 0.01) / 6, 1e-6);
  EXPECT_EQ(error.trimmed, error.all) << "two pixels: too few to leave one out";
}

TEST(PictureError, TrimmedLeavesTheWorstThousandthOut) {
  RgbPicture reference(3000, 1.0f), picture = reference;
  picture[0] = 1e6f;
  for (size_t i = 3; i < 6; ++i) picture[i] = 2;
  const RelativeError error = relative_error(picture, reference);
  EXPECT_GT(error.all, 1e8);
  EXPECT_NEAR(error.trimmed, 1 / 1.01 / 999, 1e-9);
}

TEST(PictureError, NoiseAloneIsVarianceAndNoBias) {
  const NoiseAndBias result = found(noisy(4, 0, 0.2, 1), noisy(4, 0, 0.05, 2));
  EXPECT_NEAR(result.variance.value, 0.04 * kWeight, 0.04 * kWeight * 0.05);
  EXPECT_LT(result.variance.low, 0.04 * kWeight);
  EXPECT_GT(result.variance.high, 0.04 * kWeight);
  EXPECT_FALSE(result.biased);
  EXPECT_LT(result.bias_squared.low, 0);
  EXPECT_GT(result.bias_squared.high, 0);
}

TEST(PictureError, ABiasFarBelowTheNoiseIsFound) {
  const NoiseAndBias result = found(noisy(4, 0.05, 0.2, 1), noisy(4, 0, 0.02, 2));
  EXPECT_TRUE(result.biased);
  EXPECT_NEAR(result.bias_squared.value, 0.0025 * kWeight, 0.0025 * kWeight * 0.2);
}

TEST(PictureError, IntervalsHoldTheTruthAboutAsOftenAsTheySay) {
  constexpr int kTrials = 60;
  int variance = 0, bias = 0, doubted = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto seed = static_cast<uint32_t>(100 + 2 * trial);
    const NoiseAndBias result = found(noisy(4, 0, 0.2, seed), noisy(4, 0, 0.1, seed + 1));
    variance += result.variance.low <= 0.04 * kWeight && 0.04 * kWeight <= result.variance.high;
    bias += result.bias_squared.low <= 0 && 0 <= result.bias_squared.high;
    doubted += result.biased;
  }
  EXPECT_GE(variance, kTrials * 85 / 100);
  EXPECT_GE(bias, kTrials * 85 / 100);
  EXPECT_LE(doubted, 3);
}

TEST(PictureError, FirefliesOfOneSeedAreNoBias) {
  std::vector<RgbPicture> pictures = noisy(4, 0, 0, 1);
  for (size_t i = 0; i < 30; ++i) pictures[i % 4][i * 211] = 100;
  std::vector<RgbPicture> reference = noisy(4, 0, 0, 1);
  const NoiseAndBias result = found(pictures, reference);
  EXPECT_GT(result.variance.value, 1);
  EXPECT_FALSE(result.biased);
}

TEST(PictureError, WithoutNoiseTheBiasIsExact) {
  const NoiseAndBias result = found(noisy(3, 0.1, 0, 1), noisy(1, 0, 0, 1));
  EXPECT_EQ(result.variance.value, 0);
  EXPECT_NEAR(result.bias_squared.value, 0.01 * kWeight, 1e-6);
  EXPECT_NEAR(result.bias_squared.low, result.bias_squared.high, 1e-9);
  EXPECT_TRUE(result.biased);
}

TEST(PictureError, TheReferencesNoiseIsThatOfItsPartsOrTheOneGiven) {
  ReferencePicture reference = reference_of(kSide, kSide, noisy(4, 0, 0.2, 3));
  EXPECT_TRUE(reference.noise_known());
  EXPECT_NEAR(reference.relative_noise(), 0.01 * kWeight, 0.01 * kWeight * 0.2);
  ReferencePicture given = reference_of(kSide, kSide, noisy(1, 0, 0.1, 3));
  EXPECT_FALSE(given.noise_known());
  EXPECT_EQ(given.relative_noise(), 0);
  given.variance.assign(given.mean.size(), 0.01f);
  EXPECT_TRUE(given.noise_known());
  EXPECT_FALSE(noise_and_bias(kSide, kSide, noisy(4, 0, 0.1, 5), given).biased);
  given.variance.clear();
  EXPECT_TRUE(noise_and_bias(kSide, kSide, noisy(4, 0, 0.1, 5), given).biased) << "noise that is not known counts as bias";
}

TEST(ParetoFront, KeepsWhatNothingBeatsInBothPriceAndError) {
  const PricedError choices[] = {{1, 10}, {2, 5}, {2, 6}, {3, 5}, {4, 1}, {0.5, 20}, {4, 1}, {5, 2}};
  EXPECT_EQ(pareto_front(choices), (std::vector<bool>{true, true, false, false, true, true, true, false}));
  EXPECT_TRUE(pareto_front({}).empty());
}

TEST(ParetoFront, NoOneOnItIsBeatenAndEveryoneElseIs) {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> number(0, 30);
  std::vector<PricedError> choices(200);
  for (PricedError& choice : choices) choice = {static_cast<double>(number(random)), static_cast<double>(number(random))};
  const std::vector<bool> front = pareto_front(choices);
  for (size_t i = 0; i < choices.size(); ++i) {
    bool beaten = false;
    for (const PricedError& other : choices) {
      beaten |= other.price <= choices[i].price && other.error <= choices[i].error &&
                (other.price < choices[i].price || other.error < choices[i].error);
    }
    EXPECT_EQ(front[i], !beaten) << i;
  }
}

}  // namespace
}  // namespace shoal
