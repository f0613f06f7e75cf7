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

TEST(SampleOrder, ASpanHasTheSamplesOfTheWholeThatItNames) {
  for (const uint32_t levels : {0u, 2u, SampleOrder::kAllLevels}) {
    const SampleOrder part(150, 70, SampleSpan{2, 5}, 1, levels), whole(150, 70, 3, 1, levels);
    ASSERT_EQ(part.count(), whole.count());
    for (uint64_t index = 0; index < part.count(); ++index) {
      const PixelSample a = part.at(index), b = whole.at(index);
      ASSERT_TRUE(a.x == b.x && a.y == b.y && a.sample == b.sample + 2) << index;
    }
  }
}

TEST(SampleOrder, CoarseFirstVisitsEverySampleOfEveryPixelOnce) {
  for (const auto& [width, height, samples] : {std::array{70u, 50u, 3u}, {1u, 1u, 5u}, {129u, 97u, 1u}, {3001u, 1u, 2u},
                                               {1u, 2500u, 2u}, {257u, 131u, 2u}, {1023u, 2u, 4u}}) {
    for (const uint32_t tile_sample : {1u, 3u, 16u}) {
      for (const uint32_t levels : {1u, 2u, 3u, SampleOrder::kAllLevels}) {
        SCOPED_TRACE(::testing::Message() << width << " x " << height << " x " << samples << ", one tile in "
                                          << tile_sample << ", levels: " << levels);
        const SampleOrder order(width, height, samples, tile_sample, levels), plain(width, height, samples, tile_sample);
        ASSERT_EQ(order.count(), plain.count());
        ASSERT_LE(order.first_lattice_count(), order.pixel_count());
        std::vector<int> seen(size_t{width} * height * samples);
        for (uint64_t index = 0; index < order.count(); ++index) {
          for (const PixelSample s : {order.at(index), plain.at(index)}) {
            ASSERT_TRUE(s.x < width && s.y < height && s.sample < samples) << index;
          }
          const PixelSample a = order.at(index), b = plain.at(index);
          ++seen[(size_t{a.y} * width + a.x) * samples + a.sample];
          seen[(size_t{b.y} * width + b.x) * samples + b.sample] += 100;
        }
        for (const int times : seen) ASSERT_TRUE(times == 0 || times == 101) << times;
      }
    }
  }
}

TEST(SampleOrder, CoarseFirstBeginsWithLatticesEachHalfAsWide) {
  constexpr uint32_t kWidth = 250, kHeight = 131;
  const SampleOrder order(kWidth, kHeight, 4, 1, SampleOrder::kAllLevels);
  ASSERT_EQ(order.first_spacing(), 4u);
  ASSERT_EQ(order.first_lattice_count(), 63u * 33);
  uint64_t index = 0;
  for (uint32_t spacing = order.first_spacing(); spacing > 0; spacing /= 2) {
    for (uint64_t end = uint64_t{(kWidth - 1) / spacing + 1} * ((kHeight - 1) / spacing + 1); index < end; ++index) {
      const PixelSample s = order.at(index);
      ASSERT_EQ(s.sample, 0u);
      ASSERT_TRUE(s.x % spacing == 0 && s.y % spacing == 0) << "sample " << index << " is at " << s.x << ", " << s.y;
    }
  }
  EXPECT_EQ(index, order.pixel_count());
  for (; index < order.count(); ++index) ASSERT_GT(order.at(index).sample, 0u);
}

TEST(SampleOrder, AfterTheCoarseLevelsMostSamplesComeTileByTileAsWithoutThem) {
  const SampleOrder order(640, 480, 4, 1, 3), plain(640, 480, 4);
  EXPECT_EQ(order.first_spacing(), 16u);
  uint64_t same = 0;
  for (uint64_t index = 0; index < order.count(); ++index) {
    const PixelSample a = order.at(index), b = plain.at(index);
    if (a.x == b.x && a.y == b.y && a.sample == b.sample) ++same;
  }
  EXPECT_GE(same, order.count() - 2 * (640 / 4) * (480 / 4));
}

TEST(SampleOrder, PicturesOfAnySizeHaveAboutAsManyPixelsInTheFirstLattice) {
  for (const auto& [width, height] : {std::array{256u, 256u}, {1920u, 1080u}, {3840u, 2160u}, {7680u, 4320u}}) {
    const SampleOrder order(width, height, 1, 1, SampleOrder::kAllLevels);
    EXPECT_GE(order.first_lattice_count(), 1024u) << width;
    EXPECT_LE(order.first_lattice_count(), 4400u) << width;
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
