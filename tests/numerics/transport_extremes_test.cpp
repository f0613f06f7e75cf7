// Light transport where numbers are at their ends: lobes as narrow as can be, grazing views, indices about 1, lights of no
// size or at the surface, probabilities that vanish, and films of large beside small numbers.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/film.h"
#include "engine/light_sampler.h"
#include "engine/render_report.h"
#include "tests/numerics/every_kernel.h"
#include "tests/support/layered_cases.h"
#include "tests/support/shading_scene.h"

namespace shoal::testing {
namespace {

constexpr float kEnds[] = {0, 0x1p-24f, 0.25f, 0.5f, 0.999f, 0x1.fffffep-1f};

const LobeTables& extreme_tables() {
  static const GlassTable glass({1.001f, 1.5f, 2.4f, 100});
  static const LobeTables tables{lobe_tables().energy, &glass, lobe_tables().sheen, lobe_tables().anisotropy};
  return tables;
}

struct DrawTally {
  size_t drawn = 0, none = 0, not_finite = 0, wrong = 0;
  float heaviest = 0;
};

/// Every draw is a direction of unit length with a weight, or none.
template <class AnyBsdf>
void try_draws(const AnyBsdf& bsdf, DrawTally& tally) {
  for (const float u : kEnds) {
    for (const float u1 : kEnds) {
      for (const float u2 : kEnds) {
        const BsdfSample s = bsdf.sample(u, u1, u2);
        ++tally.drawn;
        tally.not_finite += !s.finite;
        if (!(s.pdf > 0)) {
          ++tally.none;
          continue;
        }
        const float weight = max_component(s.weight);
        const bool right = std::isfinite(s.pdf) && std::isfinite(weight) && s.weight.x >= 0 && s.weight.y >= 0 &&
                           s.weight.z >= 0 && std::abs(glm::length(s.direction) - 1) < 1e-5f;
        tally.wrong += !right;
        if (right) tally.heaviest = std::max(tally.heaviest, weight);
        const BsdfValue value = bsdf.evaluate(s.direction);
        tally.not_finite += !std::isfinite(value.pdf) || !std::isfinite(max_component(value.value));
      }
    }
  }
}

std::vector<float> extreme_cosines() {
  std::vector<float> all{1, 0.9f};
  for (int power = 1; power < 149; power += power < 30 ? 2 : 17) all.push_back(std::ldexp(1.0f, -power));
  return all;
}

TEST(TransportExtremes, LobesOfAnyRoughnessAreDrawnAtAnyAngle) {
  DrawTally tally;
  for (const float roughness : {0.0f, 1e-20f, 1e-6f, 1e-3f, 0.04f, 0.3f, 1.0f}) {
    for (const LayeredCase& c : layered_cases(roughness)) {
      for (const float mu : extreme_cosines()) {
        try_draws(LayeredBsdf(c.material, lobe_tables(), kUp, kUp, view(mu)), tally);
        try_draws(Bsdf(c.material, lobe_tables().energy, kUp, kUp, view(mu)), tally);
      }
    }
  }
  EXPECT_EQ(tally.not_finite, 0u);
  EXPECT_EQ(tally.wrong, 0u);
  EXPECT_LT(tally.heaviest, 30) << "a weight is what a lobe sends out, over the chance that it is chosen";
  EXPECT_LT(tally.none, tally.drawn / 2);
  RecordProperty("draws", std::to_string(tally.drawn));
  RecordProperty("heaviest", std::to_string(tally.heaviest));
}

TEST(TransportExtremes, IndicesAboutOneAndFarFromItBendLight) {
  for (const float ior : {1.0f, 1 + 1e-6f, 1 - 1e-6f, 1.0009f, 1.001f, 1.0011f, 1.5f, 2.4f, 100.0f}) {
    for (const bool outside : {true, false}) {
      for (const float roughness : {0.0f, 0.2f, 1.0f}) {
        DrawTally tally;
        for (const float mu : extreme_cosines()) {
          try_draws(LayeredBsdf(white_glass(roughness, ior, outside), extreme_tables(), kUp, kUp, view(mu)), tally);
        }
        EXPECT_EQ(tally.not_finite, 0u) << ior << " " << outside << " " << roughness;
        EXPECT_EQ(tally.wrong, 0u) << ior << " " << outside << " " << roughness;
        EXPECT_LT(tally.heaviest, 30) << ior << " " << outside << " " << roughness;
      }
    }
  }
}

TEST(TransportExtremes, WeightsOfTwoStrategiesSumToOneWhateverTheirDensities) {
  for (int a = -1074; a < 1024; a += 9) {
    for (int b = -1074; b < 1024; b += 11) {
      const double x = std::ldexp(1.0, a), y = std::ldexp(1.0, b);
      const float w = mis_weight(x, y), other = mis_weight(y, x);
      ASSERT_TRUE(w >= 0 && w <= 1 && std::abs(w + other - 1) < 1e-6f) << x << " " << y;
    }
    ASSERT_EQ(mis_weight(std::ldexp(1.0, a), 0), 1);
    ASSERT_EQ(mis_weight(std::ldexp(1.0, a), std::numeric_limits<double>::infinity()), 0);
  }
}

ShadingOptions direct() {
  ShadingOptions options;
  options.bounces = 1;
  return options;
}

/// A white floor about the origin, and a lamp of edges `a` x `a` at a height above it.
ShadingScene floor_and_lamp(float floor, float a, float height, float radiance) {
  TriangleSoup soup;
  add_rectangle(soup, {-floor, 0, -floor}, {2 * floor, 0, 0}, {0, 0, 2 * floor}, 0);
  add_rectangle(soup, {-0.5f * a, height, -0.5f * a}, {a, 0, 0}, {0, 0, a}, 1);
  return ShadingScene(std::move(soup), {matte(Vec3(1)), lamp(Vec3(radiance))});
}

TEST(TransportExtremes, ALampOfNearlyNoAreaGivesItsLight) {
  for (const float a : {1e-3f, 1e-6f, 1e-9f, 1e-15f}) {
    // Its power is 1, or as near as a radiance below the film's largest allows.
    const float radiance = std::min(1 / (a * a), 1e11f);
    ShadingScene s = floor_and_lamp(10, a, 1, radiance);
    s.prepare(direct());
    const float expected = radiance * a * a / kPi;  // cosines and distance are 1
    const Vec3 mean = s.mean_radiance({0.5f, 2, 0}, Vec3(-0.25f, -1, 0), 200);
    EXPECT_NEAR(mean.x / expected, 1, 1e-3) << a;
    EXPECT_EQ(s.counters.invalid.total(), 0u);
  }
}

TEST(TransportExtremes, ALampOnTheFloorGivesNoMoreThanItHas) {
  for (const float height : {0.0f, 1e-30f, 1e-9f, 1e-7f, 1e-6f, 1e-5f, 1e-3f}) {
    for (const float size : {1e-3f, 1.0f, 100.0f}) {
      ShadingScene s = floor_and_lamp(1, size, height, 2);
      s.prepare(direct());
      std::mt19937 random(3);
      for (int i = 0; i < 200; ++i) {
        // Seen from below: the lamp lies behind the floor, or as near above it as can be.
        const Vec3 aim(random_vector(random, 0.5f).x, 0, random_vector(random, 0.5f).z);
        const Vec3 mean = s.mean_radiance(aim + Vec3(0.1f, i % 2 == 0 ? -1 : 1, 0.2f),
                                          Vec3(-0.1f, i % 2 == 0 ? 1 : -1, -0.2f), 4);
        ASSERT_TRUE(mean.x >= 0 && std::isfinite(mean.x));
        // From the floor's side or the lamp's: at most what the lamp has, over samples whose weights may be several times it.
        ASSERT_LT(mean.x, 200) << height << " " << size;
      }
      EXPECT_EQ(s.counters.invalid.total(), 0u) << height << " " << size;
    }
  }
}

TEST(TransportExtremes, ChancesThatVanishBesideOthersLeaveNoHole) {
  // A lamp that is 1e-40 of another one: it is as good as never drawn, but what bounces meet of it counts.
  TriangleSoup soup;
  add_rectangle(soup, {-5, 0, -5}, {10, 0, 0}, {0, 0, 10}, 0);
  add_rectangle(soup, {-1, 1, -1}, {2, 0, 0}, {0, 0, 2}, 1);
  add_rectangle(soup, {-1e-3f, 40, -1e-3f}, {2e-3f, 0, 0}, {0, 0, 2e-3f}, 2);
  ShadingScene s(std::move(soup), {matte(Vec3(1)), lamp(Vec3(1e-30f)), lamp(Vec3(1e10f))});
  s.prepare(direct());
  const Vec3 mean = s.mean_radiance({3, 1, 3}, Vec3(-1, -0.4f, -1), 2000);
  EXPECT_TRUE(std::isfinite(mean.x));
  EXPECT_GT(mean.x, 0);
  EXPECT_EQ(s.counters.invalid.total(), 0u);
}

TEST(TransportExtremes, AMillionSamplesKeepTheirSumOfLargeBesideSmall) {
  struct PixelKind {
    double least, most;
  };
  const PixelKind kinds[] = {{1e10, 1e10}, {1e-10, 1e-10}, {1e-10, 1e10}, {1e-12, 1e-9}, {1e9, 1e12}};
  Film film(static_cast<uint32_t>(std::size(kinds)), 1);
  std::vector<long double> sums(std::size(kinds));
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(0, 1);
  constexpr uint32_t kSamples = 1000000;
  for (uint32_t i = 0; i < kSamples; ++i) {
    for (uint32_t pixel = 0; pixel < std::size(kinds); ++pixel) {
      const PixelKind& k = kinds[pixel];
      const auto value = static_cast<float>(k.least * std::pow(k.most / k.least, uniform(random)) * (0.5 + uniform(random) / 2));
      sums[pixel] += static_cast<long double>(value);
      ASSERT_TRUE(film.add(pixel, Vec3(value), true));
    }
  }
  const std::vector<float> rgba = film.resolve();
  for (size_t pixel = 0; pixel < std::size(kinds); ++pixel) {
    const double exact = static_cast<double>(sums[pixel] / kSamples);
    EXPECT_LT(std::abs(rgba[4 * pixel] - exact) / exact, 1e-6) << pixel;
    const double sum = film.sum(pixel, 0).to_double();
    EXPECT_LT(std::abs(sum - static_cast<double>(sums[pixel])) / sum, 1e-7) << pixel;
  }
}

}  // namespace
}  // namespace shoal::testing
