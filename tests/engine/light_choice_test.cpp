// Which light is chosen, where on it, and with what density.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "engine/light_sampler.h"
#include "engine/math.h"
#include "tests/support/shading_scene.h"

namespace shoal {
namespace {

using namespace testing;

TEST(Distribution, ChoosesInProportionAndSkipsWhatHasNoWeight) {
  const std::vector<double> weights{0, 3, 0, 1, -2, std::nan(""), 4, 0};
  const Distribution1D d(weights);
  EXPECT_EQ(d.total(), 8);
  std::vector<int> counts(weights.size());
  for (int i = 0; i < 8000; ++i) {
    double inside = 0;
    ++counts[d.sample((i + 0.5) / 8000, &inside)];
    EXPECT_TRUE(inside >= 0 && inside < 1);
  }
  EXPECT_EQ(counts, (std::vector<int>{0, 3000, 0, 1000, 0, 0, 4000, 0}));
  EXPECT_EQ(d.sample(0, nullptr), 1u);
  EXPECT_EQ(d.sample(0x1.fffffffffffffp-1, nullptr), 6u);
  EXPECT_EQ(d.probability(6), 0.5);
  EXPECT_EQ(d.probability(7), 0);
}

TEST(Distribution, NothingToChooseFromHasNoTotal) {
  EXPECT_EQ(Distribution1D(std::vector<double>{0, 0}).total(), 0);
  EXPECT_EQ(Distribution1D(std::span<const double>()).total(), 0);
  EXPECT_EQ(Distribution1D(std::vector<double>{1e308, 1e308}).total(), 0);  // overflows: better none than nonsense
}

/// Two lamps, the second four times as large and half as bright, and a point light.
TriangleSoup two_rectangles() {
  TriangleSoup soup;
  add_rectangle(soup, {0, 1, 0}, {1, 0, 0}, {0, 0, 1}, 0);
  add_rectangle(soup, {5, 1, 0}, {2, 0, 0}, {0, 0, 2}, 1);
  return soup;
}
struct Lamps : ShadingScene {
  Lamps() : ShadingScene(two_rectangles(), {lamp(Vec3(2)), lamp(Vec3(1)), matte(Vec3(1))}) {
    scene.lights = {{PunctualType::kPoint, {0, 3, 0}, {0, -1, 0}, {1, 1, 1}, 1, 0}};
  }
};

/// What a sample of an emitter says of its density, by area.
double area_pdf(const LightSample& sample, const Vec3& position) {
  const Vec3 to_light = sample.target.point - position;
  const double cosine = std::abs(glm::dot(sample.target_normal, sample.direction));
  return sample.pdf * cosine / glm::dot(to_light, to_light);
}

TEST(LightSampler, ByPowerTheDensityOfAnEmitterIsKnownFromItsMaterialAlone) {
  const Lamps s;
  const Environment none;
  const LightSampler lights(s.scene, none, 1, LightChoice::kPower);
  ASSERT_FALSE(lights.has_tree());
  const Vec3 position(0.5f, 0, 0.25f);
  int punctual = 0, bright = 0, drawn = 0;
  constexpr int kDraws = 20000;
  for (int i = 0; i < kDraws; ++i) {
    const Random4 r = random4(1, static_cast<uint32_t>(i), 0, 0, Dimension::kLight);
    const LightSample sample = lights.sample(position, {}, {r.uniform(0), r.uniform(1), r.uniform(2)});
    ASSERT_GT(sample.pdf, 0);
    if (sample.delta) {
      ++punctual;
      continue;
    }
    ++drawn;
    const Material& material = s.scene.materials[sample.emitter->material];
    if (sample.emitter->material == 0) ++bright;
    EXPECT_NEAR(area_pdf(sample, position) / lights.emitter_pdf(material, {}, {}), 1, 1e-4);
    EXPECT_LT(glm::dot(sample.target_normal, sample.direction), 0);
  }
  // Weights: area times luminance, 2 against 4.
  EXPECT_NEAR(static_cast<double>(bright) / drawn, 1.0 / 3, 0.015);
  // Powers: 2 pi * 6 for the emitters, 4 pi for the point: half of the choice by power, half evenly.
  EXPECT_NEAR(static_cast<double>(punctual) / kDraws, 0.5 * 0.25 + 0.5 * 0.5, 0.015);
}

TEST(LightSampler, UniformlyEveryTriangleAndLampHasTheSameChance) {
  const Lamps s;
  const Environment none;
  const LightSampler lights(s.scene, none, 1, LightChoice::kUniform);
  ASSERT_FALSE(lights.has_tree());
  const Vec3 position(0.5f, 0, 0.25f);
  std::vector<int> drawn(s.scene.emitters.size());
  int punctual = 0;
  constexpr int kDraws = 20000;
  for (int i = 0; i < kDraws; ++i) {
    const Random4 r = random4(1, static_cast<uint32_t>(i), 0, 0, Dimension::kLight);
    const LightSample sample = lights.sample(position, {}, {r.uniform(0), r.uniform(1), r.uniform(2)});
    ASSERT_GT(sample.pdf, 0);
    if (sample.delta) {
      ++punctual;
      continue;
    }
    const Emitter& e = *sample.emitter;
    ++drawn[static_cast<size_t>(&e - s.scene.emitters.data())];
    const double known = lights.emitter_pdf(s.scene.materials[e.material], {e.instance, e.primitive, 0, 0}, {});
    EXPECT_NEAR(area_pdf(sample, position) / known, 1, 1e-4);
  }
  const double chance = 1.0 / (static_cast<double>(drawn.size()) + static_cast<double>(s.scene.lights.size()));
  EXPECT_NEAR(static_cast<double>(punctual) / kDraws, chance * static_cast<double>(s.scene.lights.size()), 0.015);
  for (const int n : drawn) EXPECT_NEAR(static_cast<double>(n) / kDraws, chance, 0.015);
}

TEST(LightSampler, ByTheTreeTheDensityOfAnEmitterIsThatOfItsSamples) {
  const Lamps s;
  const Environment none;
  const LightSampler lights(s.scene, none);
  ASSERT_TRUE(lights.has_tree());
  const Vec3 position(0.5f, 0, 0.25f);
  const LightReceiver receiver{position, encode_direction({0, 1, 0})};
  int punctual = 0, bright = 0, drawn = 0;
  for (uint32_t i = 0; i < 20000; ++i) {
    const Random4 r = random4(1, i, 0, 0, Dimension::kLight);
    const LightSample sample = lights.sample(position, receiver, {r.uniform(0), r.uniform(1), r.uniform(2)});
    ASSERT_GT(sample.pdf, 0);
    ++(sample.delta ? punctual : drawn);
    if (sample.delta) continue;
    const Emitter& e = *sample.emitter;
    if (e.material == 0) ++bright;
    const double known = lights.emitter_pdf(s.scene.materials[e.material], {e.instance, e.primitive, 0, 0}, receiver);
    EXPECT_NEAR(area_pdf(sample, position) / known, 1, 1e-4);
  }
  EXPECT_GT(punctual, 100);
  EXPECT_GT(bright, 0.8 * drawn) << "it is right above";
}

TEST(LightSampler, PointsCoverAnEmitterEvenly) {
  const Lamps s;
  const Environment none;
  const LightSampler lights(s.scene, none);
  std::vector<int> cells(16);
  int drawn = 0;
  for (uint32_t i = 0; i < 60000; ++i) {
    const Random4 r = random4(2, i, 0, 0, Dimension::kLight);
    const LightSample sample = lights.sample({0, 0, 0}, {}, {r.uniform(0), r.uniform(1), r.uniform(2)});
    if (sample.emitter == nullptr || sample.emitter->material != 1) continue;
    const Vec3 p = sample.target.point - Vec3(5, 1, 0);
    ASSERT_TRUE(p.x >= 0 && p.x <= 2 && p.z >= 0 && p.z <= 2 && p.y == 0);
    ++cells[std::min(3, static_cast<int>(p.x * 2)) * 4 + std::min(3, static_cast<int>(p.z * 2))], ++drawn;
  }
  double chi2 = 0;
  for (const int n : cells) chi2 += (n - drawn / 16.0) * (n - drawn / 16.0) / (drawn / 16.0);
  EXPECT_LT(chi2, 15 + 6 * std::sqrt(30.0));
}

TEST(LightSampler, LightsWithoutAnythingToGiveAreNeverChosen) {
  Lamps s;
  s.scene.materials[0].emission_weight = s.scene.materials[1].emission_weight = 0;
  s.scene.lights[0].intensity[0] = s.scene.lights[0].intensity[1] = s.scene.lights[0].intensity[2] = 0;
  const Environment none;
  const LightSampler lights(s.scene, none);
  EXPECT_TRUE(lights.empty());
  EXPECT_FALSE(lights.has_tree());
  EXPECT_EQ(lights.emitter_pdf(s.scene.materials[0], {0, s.scene.emitters[0].primitive, 0, 0}, {}), 0);
}

}  // namespace
}  // namespace shoal
