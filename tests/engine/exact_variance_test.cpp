#include "engine/exact_variance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace shoal {
namespace {

struct Sums {
  FixedPoint128 sum;
  SquareSum squares;
  uint32_t count = 0;

  void add(float value) {
    sum.add(FixedPoint128::from_float(value));
    squares.add_square(value);
    ++count;
  }
  double variance() const { return sample_variance(sum, squares, count); }
};

Sums sums_of(const std::vector<float>& values) {
  Sums sums;
  for (const float value : values) sums.add(value);
  return sums;
}

/// By its definition, in two passes.
double direct_variance(const std::vector<float>& values) {
  long double sum = 0, squares = 0;
  for (const float value : values) sum += value;
  const long double mean = sum / static_cast<long double>(values.size());
  for (const float value : values) squares += (value - mean) * (value - mean);
  return static_cast<double>(squares / static_cast<long double>(values.size() - 1));
}

TEST(ExactVariance, IsWhatItsDefinitionSays) {
  std::mt19937 random(7);
  for (const float scale : {1e-4f, 1.0f, 3e6f}) {
    for (const size_t count : {2u, 3u, 100u, 5000u}) {
      std::uniform_real_distribution<float> values(-scale, 2 * scale);
      std::vector<float> sample(count);
      for (float& value : sample) value = values(random);
      const double expected = direct_variance(sample);
      EXPECT_NEAR(sums_of(sample).variance(), expected, 1e-9 * expected) << scale << ", " << count;
    }
  }
}

TEST(ExactVariance, CancelsNothingBesideALargeMean) {
  // In double the sum of squares, 4e18, has steps of 512.
  std::vector<float> values;
  for (int i = 0; i < 1000; ++i) values.push_back(65536000.0f + static_cast<float>(8 * (i % 2)));
  EXPECT_NEAR(sums_of(values).variance(), 16.0 * 1000 / 999, 1e-9);
}

TEST(ExactVariance, OfEqualSamplesIsZero) {
  for (const float value : {0.0f, 0.1f, -0.3f, 1e-5f, 12345.678f, Film::kMaxRadiance}) {
    EXPECT_EQ(sums_of(std::vector<float>(77, value)).variance(), 0) << value;
  }
  EXPECT_EQ(sums_of({1e-30f, 2e-30f}).variance(), 0) << "too small for the sums";
}

TEST(ExactVariance, DoesNotDependOnTheOrder) {
  std::mt19937 random(3);
  std::lognormal_distribution<float> values(0, 9);
  std::vector<float> sample(999);
  for (float& value : sample) value = std::min(values(random), Film::kMaxRadiance);
  const double forwards = sums_of(sample).variance();
  std::reverse(sample.begin(), sample.end());
  EXPECT_EQ(sums_of(sample).variance(), forwards);
  EXPECT_NEAR(forwards, direct_variance(sample), 1e-9 * forwards);
}

TEST(ExactVariance, HoldsTheMostSamplesOfTheLargestValue) {
  Sums sums;
  for (uint32_t i = 0; i < 1u << 22; ++i) sums.add(i % 2 == 0 ? Film::kMaxRadiance : -Film::kMaxRadiance);
  const double n = sums.count;
  EXPECT_NEAR(sums.variance() / (0x1p80 * n / (n - 1)), 1, 1e-12);
}

TEST(ExactVariance, IsUnknownOfOneSample) {
  EXPECT_EQ(sums_of({5.0f}).variance(), 0);
  EXPECT_EQ(Sums().variance(), 0);
}

}  // namespace
}  // namespace shoal
