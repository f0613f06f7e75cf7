#include "engine/flip.h"

#include <gtest/gtest.h>

#include <cmath>

namespace shoal {
namespace {

std::vector<float> flat(uint32_t pixels, float r, float g, float b) {
  std::vector<float> rgb;
  for (uint32_t i = 0; i < pixels; ++i) rgb.insert(rgb.end(), {r, g, b});
  return rgb;
}

/// Two pictures of 16 x 12 pixels with edges, points and colours.
std::vector<float> pattern(bool test) {
  std::vector<float> rgb;
  for (int y = 0; y < 12; ++y) {
    for (int x = 0; x < 16; ++x) {
      const int red = test ? x * 3 + y * 7 : x * 7 + y * 3, blue = test ? x * y + x : x * y;
      for (const int value : {red, x * 5 + y * 11, blue}) rgb.push_back(static_cast<float>(value % 16) / 15);
    }
  }
  return rgb;
}

double flip_of_flat(const std::vector<float>& a, const std::vector<float>& b) {
  return mean_value(FlipReference(8, 8, a).compare(b));
}

TEST(Flip, IsZeroForIdenticalPictures) {
  const std::vector<float> map = FlipReference(16, 12, pattern(false)).compare(pattern(false));
  for (const float value : map) EXPECT_EQ(value, 0);
  EXPECT_EQ(mean_value(hdr_flip(16, 12, pattern(true), pattern(true))), 0);
}

TEST(Flip, HasTheValuesOfPlainTwoDimensionalFilters) {
  // Worked out apart from this program, from the paper's equations in double precision.
  const std::vector<float> map = FlipReference(16, 12, pattern(false)).compare(pattern(true));
  EXPECT_NEAR(mean_value(map), 0.245332, 2e-5);
  EXPECT_NEAR(map[0], 0.251283, 1e-4);
  EXPECT_NEAR(map[5 * 16 + 7], 0.157280, 1e-4);
  EXPECT_NEAR(map[11 * 16 + 15], 0.223171, 1e-4);
}

TEST(Flip, OfFlatColoursIsTheirDistance) {
  EXPECT_NEAR(flip_of_flat(flat(64, 0, 0, 0), flat(64, 1, 1, 1)), 0.96738, 1e-4) << "black and white";
  EXPECT_NEAR(flip_of_flat(flat(64, 0, 1, 0), flat(64, 0, 0, 1)), 1, 1e-4) << "green and blue, the largest there is";
  EXPECT_NEAR(flip_of_flat(flat(64, 1, 0, 0), flat(64, 0, 1, 0)), 0.98666, 1e-4);
  EXPECT_NEAR(flip_of_flat(flat(64, 0.2f, 0.2f, 0.2f), flat(64, 0.21f, 0.21f, 0.21f)), 0.061989, 1e-4);
}

TEST(Flip, IsTheSameWhenPicturesChangePlaces) {
  const std::vector<float> there = FlipReference(16, 12, pattern(false)).compare(pattern(true));
  const std::vector<float> back = FlipReference(16, 12, pattern(true)).compare(pattern(false));
  EXPECT_EQ(there, back);
}

TEST(Flip, StaysBetweenZeroAndOneWhateverThePixels) {
  std::vector<float> wild = pattern(false);
  for (size_t i = 0; i < wild.size(); i += 5) wild[i] = i % 2 ? -3.0f : 1e30f;
  wild[7] = std::nanf("");
  wild[8] = INFINITY;
  for (const std::vector<float>& map : {FlipReference(16, 12, wild).compare(pattern(true)),
                                        FlipReference(16, 12, pattern(true)).compare(wild),
                                        hdr_flip(16, 12, wild, pattern(true)), hdr_flip(16, 12, pattern(true), wild)}) {
    for (const float value : map) ASSERT_TRUE(value >= 0 && value <= 1) << value;
  }
}

TEST(Flip, SeesLessOfADifferenceSpreadThinnerThanTheEyeResolves) {
  std::vector<float> board, halves;
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 32; ++x) {
      for (int c = 0; c < 3; ++c) board.push_back(((x + y) & 1) != 0 ? 0.4f : 0.6f), halves.push_back(x < 16 ? 0.4f : 0.6f);
    }
  }
  const FlipReference grey(32, 32, flat(32 * 32, 0.5f, 0.5f, 0.5f));
  EXPECT_LT(mean_value(grey.compare(board)), 0.5 * mean_value(grey.compare(halves)));
}

TEST(Flip, OfHighRangeSeesDifferencesInTheDarkAndInTheBright) {
  std::vector<float> scene = flat(64, 0.01f, 0.01f, 0.01f);
  for (size_t i = 0; i < 24; ++i) scene[i] = 100;
  std::vector<float> dark = scene, bright = scene;
  for (size_t i = 150; i < 192; ++i) dark[i] *= 4;
  for (size_t i = 0; i < 24; ++i) bright[i] *= 0.5f;
  EXPECT_GT(mean_value(hdr_flip(8, 8, scene, dark)), 0.05);
  EXPECT_GT(mean_value(hdr_flip(8, 8, scene, bright)), 0.02);
  // Seen at one exposure, both are lost: black stays black, white stays white.
  EXPECT_LT(flip_of_flat(scene, bright), 1e-6);
}

TEST(Flip, OfHighRangeComparesWithABlackPicture) {
  const std::vector<float> black = flat(64, 0, 0, 0);
  EXPECT_EQ(mean_value(hdr_flip(8, 8, black, black)), 0);
  EXPECT_GT(mean_value(hdr_flip(8, 8, black, flat(64, 1, 1, 1))), 0.5);
}

}  // namespace
}  // namespace shoal
