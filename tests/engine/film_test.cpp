#include "engine/film.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <thread>

namespace shoal {
namespace {

TEST(FixedPoint128, HoldsFloatsExactlyOverItsRange) {
  for (const float value : {0.0f, 1.0f, -1.0f, 0.1f, 3.0e-10f, 1.5e10f, -2.5e-7f, 0x1p-41f, 0x1.fffffep39f}) {
    EXPECT_EQ(FixedPoint128::from_float(value).to_double(), static_cast<double>(value)) << value;
  }
  for (const float value : {-3.0e-10f, -0x1.8p-41f, -1e10f}) {
    EXPECT_EQ(FixedPoint128::from_float(value).to_double(), static_cast<double>(value)) << value;
  }
  EXPECT_EQ(FixedPoint128::from_float(1e-40f).to_double(), 0.0);
}

TEST(Film, GivesTheSameBitsForEveryOrderOfAdding) {
  std::mt19937 random(7);
  std::vector<Vec3> samples;
  for (int i = 0; i < 2000; ++i) {
    const float scale = std::ldexp(1.0f, static_cast<int>(random() % 60) - 30);
    samples.push_back(Vec3(scale * static_cast<float>(random() % 1000), scale, 1.0f));
  }
  Film forwards(1, 1), backwards(1, 1);
  for (const Vec3& s : samples) forwards.add(0, s, true);
  std::reverse(samples.begin(), samples.end());
  for (const Vec3& s : samples) backwards.add(0, s, true);
  EXPECT_EQ(forwards.resolve(), backwards.resolve());
}

TEST(Film, KeepsATinyPixelBesideAHugeOneAndSmallTermsBesideLargeOnes) {
  Film film(2, 1);
  film.add(0, Vec3(1e-10f), false);
  film.add(1, Vec3(1e10f), false);
  for (int i = 0; i < 1000000; ++i) film.add(1, Vec3(1e-3f), false);
  EXPECT_EQ(static_cast<float>(film.sum(0, 0).to_double()), 1e-10f);
  EXPECT_EQ(film.sum(1, 0).to_double(), 1e10 + 1e6 * static_cast<double>(1e-3f));
}

TEST(Film, SaysWhenARadianceIsClamped) {
  Film film(1, 1);
  EXPECT_TRUE(film.add(0, Vec3(1), true));
  EXPECT_FALSE(film.add(0, Vec3(1e30f, 0, 0), true));
  EXPECT_EQ(film.resolve()[0], (Film::kMaxRadiance + 1) / 2);
}

TEST(Film, GivesTheMeanOfWhatAPixelHasSoFar) {
  Film film(2, 1);
  float rgb[3] = {1, 1, 1};
  EXPECT_EQ(film.mean(1, rgb), 0u);
  EXPECT_EQ(rgb[0], 0.0f);
  film.add(1, Vec3(1, 2, 3), true);
  film.add(1, Vec3(2, 2, 0), false);
  EXPECT_EQ(film.mean(1, rgb), 2u);
  EXPECT_EQ((std::vector<float>(rgb, rgb + 3)), (std::vector<float>{1.5f, 2, 1.5f}));
  const std::vector<float> rgba = film.resolve();
  EXPECT_EQ((std::vector<float>(rgba.begin() + 4, rgba.end())), (std::vector<float>{1.5f, 2, 1.5f, 0.5f}));
  EXPECT_EQ(film.mean(0, rgb), 0u);
}

TEST(Film, LosesNothingWhenThreadsShareAPixel) {
  Film film(1, 1);
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&film] {
      for (int i = 0; i < 10000; ++i) film.add(0, Vec3(0.1f, 1, 2), i % 2 == 0);
    });
  }
  for (std::thread& thread : threads) thread.join();
  const std::vector<float> rgba = film.resolve();
  EXPECT_EQ(rgba, (std::vector<float>{0.1f, 1, 2, 0.5f}));
}

}  // namespace
}  // namespace shoal
