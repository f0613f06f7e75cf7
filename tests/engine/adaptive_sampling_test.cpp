// Deciding where to sample, with samples that are made up: that it moves no mean, that its errors are what they are said
// to be, and that it goes on where there is noise and ends where there is none.
#include "engine/adaptive_sampling.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <thread>

#include "engine/pass_plan.h"
#include "engine/sampler.h"

namespace shoal {
namespace {

/// The value of a sample, from a number in [0, 1) of its own.
using Draw = std::function<float(uint32_t x, uint32_t y, uint32_t sample, float random)>;

struct Picture {
  Picture(uint32_t width, uint32_t height) : film(width, height, 2), self_judged(width, height, 2) {}
  Film film;
  Film self_judged;  ///< of the samples that count when each half decides for itself
  std::vector<float> errors;
  std::optional<NoiseReached> reached;
  uint64_t drawn = 0;
  uint32_t most = 0;  ///< samples of a pixel

  float value(size_t pixel) const { return mean(film, pixel); }
  static float mean(const Film& film, size_t pixel) {
    float rgb[3];
    film.mean(static_cast<uint32_t>(pixel), rgb);
    return rgb[0];
  }
};

void draw_pass(AdaptiveSampling& adaptive, Picture& picture, SampleSpan span, const Draw& draw, uint64_t seed) {
  const uint32_t width = picture.film.width(), height = picture.film.height();
  const SampleOrder order(width, height, span, adaptive.blocks());
  picture.drawn += order.count();
  for (uint64_t i = 0; i < order.count(); ++i) {
    const PixelSample s = order.at(i);
    const uint32_t pixel = s.y * width + s.x, half = AdaptiveSampling::half_of(s.sample);
    const Vec3 value(draw(s.x, s.y, s.sample, random4(seed, pixel, s.sample, 0, Dimension::kPixel).uniform(0)));
    adaptive.add(pixel, s.sample, value, true);
    if (adaptive.counts(pixel, s.sample)) picture.film.add(pixel, value, true, half);
    if (adaptive.counts(pixel, s.sample ^ 1)) picture.self_judged.add(pixel, value, true, half);
  }
}

Picture sampled(uint32_t width, uint32_t height, NoiseTarget target, uint32_t most, const Draw& draw, uint64_t seed = 1) {
  AdaptiveSampling adaptive(width, height, target, 1);
  Picture picture(width, height);
  while (picture.most < most && !adaptive.blocks().empty()) {
    const SampleSpan span{picture.most, std::min(next_level(picture.most), most)};
    draw_pass(adaptive, picture, span, draw, seed);
    picture.most = span.end;
    adaptive.end_pass(picture.film, span.end);
  }
  picture.reached = adaptive.finish(picture.film, picture.errors);
  return picture;
}

/// How many standard errors the mean of all pixels is away from `expected`.
double deviation(const Film& film, double expected) {
  const size_t pixels = size_t{film.width()} * film.height();
  double sum = 0, squares = 0;
  for (size_t i = 0; i < pixels; ++i) {
    const double value = Picture::mean(film, i);
    sum += value, squares += value * value;
  }
  const double count = static_cast<double>(pixels), mean = sum / count;
  return (mean - expected) / std::sqrt((squares / count - mean * mean) / count);
}

/// Rare and bright: the mean is 1.
Draw flashes(float share) {
  return [share](uint32_t, uint32_t, uint32_t, float random) { return random < share ? 1 / share : 0.0f; };
}
/// A heavy tail of mean 1: the moments from 1 / `power` on are infinite.
float heavy_tailed(float random, float power) { return (1 - power) * std::pow(1 - random, -power); }

TEST(AdaptiveSampling, MovesNoMeanWhereAHalfThatDecidesForItselfWould) {
  const auto heavy = [](uint32_t, uint32_t, uint32_t, float random) { return heavy_tailed(random, 0.4f); };
  for (const auto& [name, draw, target] : {std::tuple{"rare flashes", flashes(0.05f), 0.69f},
                                           std::tuple{"flashes", flashes(0.4f), 0.23f},
                                           std::tuple{"heavy tail", Draw(heavy), 0.115f}}) {
    double sum = 0, self_judged = 0;
    constexpr int kSeeds = 2;
    for (int seed = 1; seed <= kSeeds; ++seed) {
      const Picture picture = sampled(256, 256, {target, 4 * target}, 256, draw, static_cast<uint64_t>(seed));
      sum += deviation(picture.film, 1) / std::sqrt(kSeeds);
      self_judged += deviation(picture.self_judged, 1) / std::sqrt(kSeeds);
    }
    std::printf("%s: %.2f standard errors; judged by itself %.2f\n", name, sum, self_judged);
    EXPECT_LT(std::abs(sum), 3.3) << name;
    EXPECT_GT(std::abs(self_judged), 5) << name << ": so the test would see it";
  }
}

TEST(AdaptiveSampling, ErrorsAreWhatTheyAreSaidToBe) {
  // Kinds of pixels in blocks and side by side: calm, noisy, flashing, a heavy tail.
  const auto kind = [](uint32_t x, uint32_t y) { return y < 64 ? x / 32 % 4 : (x * 7 + y * 3) % 4; };
  const auto draw = [&](uint32_t x, uint32_t y, uint32_t, float random) {
    switch (kind(x, y)) {
      case 0: return 0.9f + 0.2f * random;
      case 1: return 2 * random;
      case 2: return random < 0.03f ? 1 / 0.03f : 0.0f;
      default: return heavy_tailed(random, 0.35f);
    }
  };
  for (const float target : {0.3f, 0.1f, 0.05f}) {
    const Picture picture = sampled(128, 128, {target, 2 * target}, 4096, draw);
    double inside[8] = {}, all = 0;  // by kind, in blocks and then side by side
    for (uint32_t y = 0; y < 128; ++y) {
      for (uint32_t x = 0; x < 128; ++x) {
        const size_t pixel = size_t{y} * 128 + x;
        if (std::abs(picture.value(pixel) - 1) > 1.96f * picture.errors[pixel]) continue;
        inside[kind(x, y) + (y < 64 ? 0 : 4)] += 1.0 / (128 * 128 / 8);
        all += 1.0 / (128 * 128);
      }
    }
    for (int k = 0; k < 8; ++k) {
      std::printf("target %.2f, kind %d: %.2f %% within 1.96 standard errors\n", target, k, 100 * inside[k]);
      // A pixel that flashes among others that do not, and has not yet, cannot be told from them.
      EXPECT_GE(inside[k], k == 6 ? 0.88 : 0.93) << "target " << target << ", kind " << k;
    }
    EXPECT_GE(all, 0.93) << "target " << target;
    EXPECT_TRUE(picture.reached->meets({target, 2 * target}));
  }
}

TEST(AdaptiveSampling, ErrorsAreNotMuchLargerThanTheyAre) {
  const auto draw = [](uint32_t x, uint32_t, uint32_t, float random) { return x < 64 ? 2 * random : 0.5f + random; };
  const Picture picture = sampled(128, 128, {0.05f, 0.1f}, 4096, draw);
  double squares = 0;
  for (size_t i = 0; i < 128 * 128; ++i) squares += std::pow((picture.value(i) - 1) / picture.errors[i], 2);
  EXPECT_NEAR(std::sqrt(squares / (128 * 128)), 1, 0.03);
}

TEST(AdaptiveSampling, GoesOnWhereThereIsNoiseUntilTheTargetIsMet) {
  const auto draw = [](uint32_t x, uint32_t, uint32_t, float random) {
    return x < 32 ? 1.0f : x < 96 ? 0.9f + 0.2f * random : 2 * random;
  };
  const Picture picture = sampled(128, 64, {0.03f, 0.06f}, 4096, draw);
  ASSERT_TRUE(picture.reached);
  EXPECT_LE(picture.reached->median, 0.03f);
  EXPECT_LE(picture.reached->percentile_95, 0.06f);
  EXPECT_EQ(picture.film.added(0), 16u) << "nothing to see";
  EXPECT_EQ(picture.film.added(60), 16u) << "calm enough";
  // A relative deviation of 0.577 in the third that is over 6 %: n = (0.577 / (0.95 * 0.06))^2 = 102.
  EXPECT_GE(picture.film.added(120), 96u);
  EXPECT_LE(picture.film.added(120), 192u);
}

TEST(AdaptiveSampling, AFewPixelsMayStayNoisy) {
  const auto draw = [](uint32_t x, uint32_t y, uint32_t, float random) {
    return x < 8 && y < 8 ? (random < 0.01f ? 100.0f : 0.0f) : 0.5f + random;
  };
  const Picture picture = sampled(128, 128, {0.05f, 0.1f}, 1u << 16, draw);
  EXPECT_TRUE(picture.reached->meets({0.05f, 0.1f}));
  EXPECT_LE(picture.most, 64u) << "one block in 256 is not 5 % of the pixels";
}

TEST(AdaptiveSampling, TheMostEndsIt) {
  const Picture picture = sampled(32, 32, {0.001f, 0.002f}, 100, flashes(0.1f));
  EXPECT_EQ(picture.most, 100u);
  for (size_t i = 0; i < 32 * 32; ++i) EXPECT_EQ(picture.film.added(i), 100u);
  EXPECT_FALSE(picture.reached->meets({0.001f, 0.002f}));
  EXPECT_GT(picture.reached->median, 0.2f);
}

TEST(AdaptiveSampling, TooFewSamplesToTellSayNothing) {
  EXPECT_FALSE(sampled(32, 32, {0.01f, 0.02f}, 2, flashes(0.1f)).reached);
  EXPECT_TRUE(sampled(32, 32, {0.01f, 0.02f}, 4, flashes(0.1f)).reached);
}

TEST(AdaptiveSampling, WhatAHalfHasJudgedIsDoneToTheOther) {
  AdaptiveSampling adaptive(8, 8, {0.01f, 0.02f}, 1);
  Picture picture(8, 8);
  const auto even_calm = [](uint32_t, uint32_t, uint32_t sample, float random) { return sample % 2 == 0 ? 1 : 2 * random; };
  draw_pass(adaptive, picture, {0, 16}, even_calm, 1);
  adaptive.end_pass(picture.film, 16);
  ASSERT_EQ(adaptive.blocks().size(), 1u) << "the odd half wants to see more";
  EXPECT_TRUE(adaptive.counts(5, 16)) << "of the even half";
  EXPECT_FALSE(adaptive.counts(5, 17)) << "the even half has seen enough";
  draw_pass(adaptive, picture, {16, 24}, even_calm, 1);
  EXPECT_EQ(picture.film.added(5, 0), 12u);
  EXPECT_EQ(picture.film.added(5, 1), 8u);
}

TEST(AdaptiveSampling, BlackAndConstantPicturesEndAfterThePilot) {
  for (const float value : {0.0f, 1e-9f, 3e9f}) {
    const Picture picture = sampled(20, 12, {0.01f, 0.02f}, 4096, [=](uint32_t, uint32_t, uint32_t, float) { return value; });
    EXPECT_EQ(picture.most, 2 * AdaptiveSampling::kPilot);
    EXPECT_EQ(picture.reached->median, 0);
    EXPECT_EQ(picture.reached->percentile_95, 0);
  }
}

TEST(AdaptiveSampling, JudgesTheSameWhateverTheOrderOfAddingAndTheThreads) {
  constexpr uint32_t kSide = 40;
  const auto value_of = [](uint32_t pixel, uint32_t sample) {
    const float random = random4(3, pixel, sample, 0, Dimension::kPixel).uniform(0);
    return Vec3(random < 0.1f ? 1e6f * random : static_cast<float>(pixel % kSide) * 0.01f);
  };
  std::vector<std::vector<uint32_t>> blocks;
  std::vector<std::vector<float>> errors;
  for (const unsigned threads : {1u, 4u}) {
    AdaptiveSampling adaptive(kSide, kSide, {0.2f, 0.5f}, threads);
    Film film(kSide, kSide, 2);
    std::vector<std::thread> team;
    for (unsigned t = 0; t < threads; ++t) {
      team.emplace_back([&, t] {
        for (uint32_t i = t; i < kSide * kSide * 16; i += threads) {
          const uint32_t index = threads == 1 ? i : kSide * kSide * 16 - 1 - i;
          const uint32_t pixel = index % (kSide * kSide), sample = index / (kSide * kSide);
          adaptive.add(pixel, sample, value_of(pixel, sample), true);
          film.add(pixel, value_of(pixel, sample), true, AdaptiveSampling::half_of(sample));
        }
      });
    }
    for (std::thread& thread : team) thread.join();
    adaptive.end_pass(film, 16);
    blocks.push_back(adaptive.blocks());
    adaptive.finish(film, errors.emplace_back());
  }
  EXPECT_FALSE(blocks[0].empty());
  EXPECT_EQ(blocks[0], blocks[1]);
  EXPECT_EQ(errors[0], errors[1]);
}

TEST(AdaptiveSampling, PixelsThatAreNotRenderedAreLeftOut) {
  AdaptiveSampling adaptive(32, 8, {0.01f, 0.02f}, 1);
  Film film(32, 8, 2);
  for (uint32_t pixel = 0; pixel < 32 * 8; ++pixel) {
    for (uint32_t sample = 0; sample < 16 && pixel % 32 >= 16; ++sample) {
      adaptive.add(pixel, sample, Vec3(static_cast<float>(sample)), true);
      film.add(pixel, Vec3(static_cast<float>(sample)), true, sample % 2);
    }
  }
  adaptive.end_pass(film, 16);
  EXPECT_EQ(adaptive.blocks(), (std::vector<uint32_t>{2, 3}));
  EXPECT_TRUE(adaptive.whole_picture());
  EXPECT_EQ(adaptive.drawn_pixels(), 128u);
  std::vector<float> errors;
  const auto reached = adaptive.finish(film, errors);
  ASSERT_TRUE(reached);
  EXPECT_GT(reached->median, 0.1f) << "of the pixels that there are";
  EXPECT_EQ(errors[0], 0);
}

TEST(AdaptiveSampling, ForetellsHowManySamplesItTakes) {
  constexpr uint32_t kSide = 64;
  const auto draw = [](uint32_t, uint32_t, uint32_t, float random) { return 2 * random; };
  AdaptiveSampling adaptive(kSide, kSide, {0.02f, 0.04f}, 1);
  Picture picture(kSide, kSide);
  draw_pass(adaptive, picture, {0, 16}, draw, 1);
  adaptive.end_pass(picture.film, 16);
  const double expected = std::pow(0.577 / (0.95 * 0.02), 2) - 16;  // samples more
  EXPECT_NEAR(static_cast<double>(adaptive.expected_samples(1u << 20)) / (kSide * kSide), expected, 0.1 * expected);
  EXPECT_EQ(adaptive.expected_samples(20), uint64_t{kSide} * kSide * 4) << "no pixel gets more than the most";
}

TEST(NoiseTarget, IsParsedAndMistakesAreSaid) {
  const auto parsed = [](const char* text) { return parse_noise_target(text).value(); };
  EXPECT_FALSE(parsed("").asked());
  EXPECT_FLOAT_EQ(parsed("0.02").median, 0.02f);
  EXPECT_FLOAT_EQ(parsed("0.02").percentile_95, 0.04f);
  EXPECT_FLOAT_EQ(parsed("2%").median, 0.02f);
  EXPECT_FLOAT_EQ(parsed("2%:0.1").percentile_95, 0.1f);
  EXPECT_FLOAT_EQ(parsed("0.02:0.02").percentile_95, 0.02f);
  for (const char* wrong : {"0", "-1", "2", "nan", "inf", "2%:1%", "x", "0.1:", ":0.1", "0.1:0.2:0.3", "%", "0.1 "}) {
    const auto target = parse_noise_target(wrong);
    ASSERT_FALSE(target.ok()) << wrong;
    EXPECT_EQ(target.error().code, ErrorCode::kUsage);
    EXPECT_NE(target.error().message.find(wrong), std::string::npos);
  }
}

}  // namespace
}  // namespace shoal
