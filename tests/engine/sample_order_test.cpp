#include "engine/sample_order.h"

#include <gtest/gtest.h>

#include <array>
#include <vector>

namespace shoal {
namespace {

TEST(SampleOrder, VisitsEverySampleOfEveryPixelOnce) {
  for (const auto& [width, height, samples] : {std::array{70u, 50u, 3u}, {1u, 1u, 5u}, {32u, 64u, 1u}, {33u, 1u, 2u}}) {
    const SampleOrder order(width, height, samples);
    std::vector<int> seen(width * height * samples);
    for (uint64_t index = 0; index < order.count(); ++index) {
      const PixelSample s = order.at(index);
      ASSERT_LT(s.x, width);
      ASSERT_LT(s.y, height);
      ASSERT_LT(s.sample, samples);
      ++seen[(s.y * width + s.x) * samples + s.sample];
    }
    for (const int times : seen) EXPECT_EQ(times, 1);
  }
}

TEST(SampleOrder, ASampleOfTilesIsWholeTilesSpreadOverThePicture) {
  constexpr uint32_t kWidth = 32 * 40 + 7, kHeight = 32 * 30 + 5, kOneIn = 16;
  const SampleOrder order(kWidth, kHeight, 2, kOneIn);
  std::vector<int> seen(kWidth * kHeight);
  for (uint64_t index = 0; index < order.count(); ++index) {
    const PixelSample s = order.at(index);
    ASSERT_LT(s.x, kWidth);
    ASSERT_LT(s.y, kHeight);
    EXPECT_EQ(s.sample, index % 2);
    ++seen[s.y * kWidth + s.x];
  }
  uint64_t pixels = 0, quarters[4] = {};
  for (uint32_t y = 0; y < kHeight; ++y) {
    for (uint32_t x = 0; x < kWidth; ++x) {
      const int times = seen[y * kWidth + x];
      ASSERT_EQ(times, seen[y / 32 * 32 * kWidth + x / 32 * 32]) << "part of a tile";
      ASSERT_TRUE(times == 0 || times == 2);
      pixels += times / 2;
      quarters[(y > kHeight / 2 ? 2 : 0) + (x > kWidth / 2 ? 1 : 0)] += times / 2;
    }
  }
  EXPECT_EQ(pixels, order.pixel_count());
  EXPECT_NEAR(static_cast<double>(pixels) * kOneIn, kWidth * kHeight, 0.05 * kWidth * kHeight);
  for (const uint64_t quarter : quarters) EXPECT_GT(quarter * kOneIn * 8, kWidth * kHeight);
}

TEST(SampleOrder, ASampleOfTilesHasAtLeastOneTile) {
  const SampleOrder order(100, 20, 3, 1000);
  EXPECT_GT(order.count(), 0u);
  EXPECT_LE(order.pixel_count(), 32u * 20);
}

}  // namespace
}  // namespace shoal
