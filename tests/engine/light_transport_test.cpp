// Whole paths against closed formulas: emitters, punctual lights, environment, bounces.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/light_sampler.h"
#include "engine/math.h"
#include "tests/support/shading_scene.h"

namespace shoal {
namespace {

using namespace testing;

constexpr Vec3 kAlbedo(0.2f, 0.5f, 0.8f);
constexpr Vec3 kLamp(3, 4, 5);

/// Irradiance at the origin (normal +y) of a Lambertian rectangle [-a,a] x [-b,b] at height h, radiance 1: four
/// times the view factor of a corner rectangle (Howell, A Catalog of Radiation Heat Transfer Configuration Factors,
/// B-3).
double rectangle_irradiance(double a, double b, double h) {
  const double x = a / h, y = b / h, rx = std::sqrt(1 + x * x), ry = std::sqrt(1 + y * y);
  return 2 * (x / rx * std::atan(y / rx) + y / ry * std::atan(x / ry));
}

/// A large floor at y = 0 and, when asked for, a rectangle lamp of 2a x 2b above the origin.
ShadingScene floor_scene(float a, float b, float h, bool lamp_above = true) {
  TriangleSoup soup;
  add_rectangle(soup, {-50, 0, -50}, {100, 0, 3}, {0, 0, 100}, 0);
  if (lamp_above) add_rectangle(soup, {-a, h, -b}, {2 * a, 0, 0}, {0, 0, 2 * b}, 1);
  return ShadingScene(std::move(soup), {matte(kAlbedo), lamp(kLamp)});
}

ShadingOptions with_bounces(uint32_t bounces) {
  ShadingOptions options;
  options.bounces = bounces;
  options.roulette_start = 100;
  return options;
}

const Vec3 kEye(0.3f, 0.5f, -7);
const Vec3 kDown = glm::normalize(-kEye);

void expect_close(const Vec3& value, const Vec3& expected, float relative) {
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(value[c], expected[c], relative * std::abs(expected[c])) << "channel " << c;
}

TEST(LightTransport, ARectangleLightGivesItsClosedFormIrradiance) {
  for (const Vec3 size : {Vec3(1, 0.5f, 1), Vec3(0.1f, 0.1f, 2), Vec3(8, 8, 0.7f)}) {
    ShadingScene s = floor_scene(size.x, size.y, size.z);
    s.prepare(with_bounces(1));
    const float irradiance = static_cast<float>(rectangle_irradiance(size.x, size.y, size.z));
    expect_close(s.mean_radiance(kEye, kDown, 20000), kAlbedo * kLamp * (irradiance / kPi), 0.02f);
  }
}

TEST(LightTransport, BsdfSamplingAloneAgreesWithTheSame) {
  ShadingScene s = floor_scene(2, 2, 1);
  s.scene.emitters.clear();  // nothing to sample: emission is found by bounces, in full
  s.prepare(with_bounces(1));
  const float irradiance = static_cast<float>(rectangle_irradiance(2, 2, 1));
  expect_close(s.mean_radiance(kEye, kDown, 20000), kAlbedo * kLamp * (irradiance / kPi), 0.02f);
  EXPECT_EQ(s.shadow_rays, 0);
}

TEST(LightTransport, MultipleImportanceSamplingBeatsBothStrategiesNearALargeLight) {
  // Under a large light close by, area sampling has a singular variance that the heuristic must remove.
  ShadingScene s = floor_scene(8, 8, 0.1f);
  s.prepare(with_bounces(1));
  const Vec3 below_lamp(0.3f, 0.05f, -4);
  double sum = 0, squares = 0;
  constexpr int kSamples = 5000;
  for (uint32_t i = 0; i < kSamples; ++i) {
    const double y = s.radiance(below_lamp, glm::normalize(-below_lamp), 3, i).y;
    sum += y, squares += y * y;
  }
  const double mean = sum / kSamples, deviation = std::sqrt(squares / kSamples - mean * mean);
  EXPECT_NEAR(mean, kAlbedo.y * kLamp.y, 0.02 * mean);
  EXPECT_LT(deviation, 0.5 * mean);
}

TEST(LightTransport, BouncesCountScatteringEvents) {
  ShadingScene s = floor_scene(1, 1, 1);
  s.prepare(with_bounces(0));
  EXPECT_EQ(s.radiance(kEye, kDown, 0, 0), Vec3(0));
  EXPECT_EQ(s.radiance({0, 0.5f, 0}, {0, 1, 0}, 0, 0), kLamp);  // seen directly
  EXPECT_EQ(s.radiance({0, 2, 0}, {0, -1, 0}, 0, 0), kLamp);    // and from behind
  EXPECT_EQ(s.shadow_rays, 0);
}

TEST(LightTransport, TwoFacingPlatesGiveTheirGeometricSeries) {
  // Two infinite (here very large) plates, one of them glowing: radiosity B1 = L + r B2, B2 = r B1 (black lamp: B2
  // = r L).
  TriangleSoup soup;
  add_rectangle(soup, {-500, 0, -500}, {1000, 0, 0}, {0, 0, 1000}, 0);
  add_rectangle(soup, {-500, 1, -500}, {1000, 0, 0}, {0, 0, 1000}, 1);
  Material glowing = lamp(Vec3(1));
  for (float& c : glowing.base_color) c = 0.6f;
  ShadingScene s(std::move(soup), {matte(Vec3(0.5f)), glowing});
  ShadingOptions options = with_bounces(60);
  options.roulette_start = 3;
  s.prepare(options);
  const float floor_radiance = 0.5f / (1 - 0.5f * 0.6f);
  expect_close(s.mean_radiance({0, 0.5f, 0}, glm::normalize(Vec3(0.1f, -1, 0)), 20000), Vec3(floor_radiance),
               0.02f);
}

TEST(LightTransport, RussianRouletteChangesNothingOnAverage) {
  ShadingScene s = floor_scene(3, 3, 0.5f);
  s.scene.materials[1].base_color[0] = s.scene.materials[1].base_color[1] = 0.9f;
  s.prepare(with_bounces(8));
  const Vec3 without = s.mean_radiance(kEye, kDown, 20000);
  ShadingOptions options = with_bounces(8);
  options.roulette_start = 0;
  options.seed = 5;
  s.prepare(options);
  expect_close(s.mean_radiance(kEye, kDown, 20000), without, 0.03f);
}

TEST(LightTransport, EverySamplerHasTheSameMean) {
  struct Estimate {
    double mean = 0, variance = 0;  ///< of the mean of all pixels
  };
  const auto estimate = [](SamplerKind kind) {
    ShadingScene s = floor_scene(2, 2, 1);
    s.scene.materials[1].base_color[1] = 0.8f;
    ShadingOptions options = with_bounces(4);
    options.sampler = kind, options.seed = 3, options.roulette_start = 1;
    s.prepare(options);
    constexpr uint32_t kPixels = 1500, kSamples = 16;
    double sum = 0, squares = 0;
    for (uint32_t pixel = 0; pixel < kPixels; ++pixel) {
      double mean = 0;
      for (uint32_t i = 0; i < kSamples; ++i) mean += s.radiance(kEye, kDown, pixel, i).y / kSamples;
      sum += mean, squares += mean * mean;
    }
    const double mean = sum / kPixels;
    return Estimate{mean, (squares / kPixels - mean * mean) / kPixels};
  };
  const Estimate independent = estimate(SamplerKind::kIndependent);
  ASSERT_LT(std::sqrt(independent.variance), 0.01 * independent.mean) << "too noisy to tell";
  for (const SamplerKind kind : {SamplerKind::kSobol, SamplerKind::kBlueNoise}) {
    // Pixels of the blue noise are not independent: their mean is better than `variance` says, never worse.
    const Estimate even = estimate(kind);
    EXPECT_NEAR(even.mean, independent.mean, 4 * std::sqrt(even.variance + independent.variance));
    EXPECT_LT(even.variance, 0.7 * independent.variance) << "what it is for";
  }
}

TEST(LightTransport, APointLightFollowsTheInverseSquare) {
  ShadingScene s = floor_scene(1, 1, 1, false);
  for (const float height : {0.5f, 2.0f, 30.0f}) {
    s.scene.lights = {{PunctualType::kPoint, {0, height, 0}, {0, -1, 0}, {10, 20, 30}, 1, 0}};
    s.prepare(with_bounces(1));
    expect_close(s.radiance(kEye, kDown, 0, 0), kAlbedo / kPi * Vec3(10, 20, 30) / (height * height), 1e-4f);
  }
}

TEST(LightTransport, ALightWithARangeFadesTowardsItsEnd) {
  ShadingScene s = floor_scene(1, 1, 1, false);
  const auto brightness = [&](PunctualType type, float height, float range) {
    s.scene.lights = {{type, {0, height, 0}, {0, -1, 0}, {1, 1, 1}, 1, 0, range}};
    s.prepare(with_bounces(1));
    return s.radiance(kEye, kDown, 0, 0).x / (kAlbedo.x / kPi) * height * height;
  };
  for (const PunctualType type : {PunctualType::kPoint, PunctualType::kSpot}) {
    EXPECT_NEAR(brightness(type, 2, 0), 1, 1e-4f);  // none
    EXPECT_NEAR(brightness(type, 2, 4), 1 - 1.0f / 16, 1e-4f);
    EXPECT_NEAR(brightness(type, 3, 4), 1 - 81.0f / 256, 1e-4f);
    EXPECT_EQ(brightness(type, 4.01f, 4), 0);
  }
}

TEST(LightTransport, ADirectionalLightGivesItsLux) {
  ShadingScene s = floor_scene(1, 1, 1, false);
  const Vec3 d = glm::normalize(Vec3(1, -2, 0.5f));
  s.scene.lights = {{PunctualType::kDirectional, {0, 0, 0}, {d.x, d.y, d.z}, {1, 2, 3}, 1, 0}};
  s.prepare(with_bounces(1));
  expect_close(s.radiance(kEye, kDown, 0, 0), kAlbedo / kPi * Vec3(1, 2, 3) * -d.y, 1e-4f);
}

TEST(LightTransport, ASpotFadesBetweenItsCones) {
  ShadingScene s = floor_scene(1, 1, 1, false);
  const float inner = std::cos(0.2f), outer = std::cos(0.4f);
  const auto brightness = [&](float angle) {
    s.scene.lights = {
        {PunctualType::kSpot, {0, 1, 0}, {std::sin(angle), -std::cos(angle), 0}, {1, 1, 1}, inner, outer}};
    s.prepare(with_bounces(1));
    return s.radiance(kEye, kDown, 0, 0).x / (kAlbedo.x / kPi);
  };
  EXPECT_NEAR(brightness(0.1f), 1, 1e-4f);
  EXPECT_EQ(brightness(0.41f), 0);
  const float x = (std::cos(0.3f) - outer) / (inner - outer);
  EXPECT_NEAR(brightness(0.3f), x * x, 1e-3f);
}

TEST(LightTransport, ManyLightsOfAllKindsAddUp) {
  ShadingScene s = floor_scene(1, 0.5f, 1);
  s.scene.lights = {{PunctualType::kPoint, {0, 0.7f, 0}, {0, -1, 0}, {1, 1, 1}, 1, 0},
                    {PunctualType::kDirectional, {0, 0, 0}, {0, -1, 0}, {1, 1, 1}, 1, 0},  // hidden by the lamp
                    {PunctualType::kPoint, {0, 0.9f, 0}, {0, -1, 0}, {0.01f, 0.01f, 0.01f}, 1, 0}};
  s.prepare(with_bounces(1));
  const float irradiance = static_cast<float>(rectangle_irradiance(1, 0.5, 1));
  const Vec3 expected = kAlbedo / kPi * (kLamp * irradiance + Vec3(1 / 0.49f + 0.01f / 0.81f));
  expect_close(s.mean_radiance(kEye, kDown, 40000), expected, 0.02f);
}

TEST(LightTransport, AConstantSkyGivesPiTimesItsRadiance) {
  ShadingScene s = floor_scene(1, 1, 1, false);
  ShadingOptions options = with_bounces(4);
  options.environment.kind = EnvironmentOptions::Kind::kConstant;
  options.environment.radiance = {1, 2, 3};
  s.prepare(options);
  expect_close(s.mean_radiance(kEye, kDown, 100), kAlbedo * Vec3(1, 2, 3), 1e-4f);
  EXPECT_EQ(s.radiance(kEye, {0, 1, 0}, 0, 0), Vec3(1, 2, 3));
  EXPECT_FALSE(s.tables->has_lights());
}

TEST(LightTransport, ATransformedSceneLooksTheSame) {
  TriangleSoup soup;
  const Affine3 m{{2, 0, 0}, {0.5f, 0.25f, 0}, {0, 0, -4}, {3, 5, -7}};  // sheared, scaled, mirrored
  add_rectangle(soup, {-50, -20, -50}, {100, 0, 0}, {0, 0, 100}, 0);     // y = 0 in the world
  add_rectangle(soup, {-2.75f, -16, -2}, {1, 0, 0}, {0, 0, 0.25f}, 1);
  ShadingScene s(std::move(soup), {matte(kAlbedo), lamp(kLamp)}, m);
  s.prepare(with_bounces(1));
  // The lamp's rectangle in the world: 2 x 1 at height 1, its middle above `below`.
  const Vec3 middle = m.point({-2.25f, -16, -1.875f}), below(middle.x, 0, middle.z);
  const float irradiance = static_cast<float>(rectangle_irradiance(1, 0.5, 1));
  expect_close(s.mean_radiance(below + Vec3(4, 0.5f, 0), glm::normalize(Vec3(-4, -0.5f, 0)), 20000),
               kAlbedo * kLamp * (irradiance / kPi), 0.02f);
}

TEST(LightTransport, PathsAreFunctionsOfSeedPixelAndSample) {
  ShadingScene s = floor_scene(2, 2, 1);
  s.prepare(with_bounces(5));
  const Vec3 first = s.radiance(kEye, kDown, 4, 9);
  s.radiance(kEye, kDown, 1, 1);
  EXPECT_EQ(s.radiance(kEye, kDown, 4, 9), first);
  EXPECT_NE(s.radiance(kEye, kDown, 5, 9), first);
}

TEST(LightTransport, ContributionsThatAreNotFiniteAreDroppedAndCounted) {
  ShadingScene s = floor_scene(1, 1, 1);
  s.scene.materials[1].emissive[1] = std::numeric_limits<float>::infinity();
  s.prepare(with_bounces(2));
  for (uint32_t i = 0; i < 50; ++i) EXPECT_TRUE(std::isfinite(s.radiance(kEye, kDown, 0, i).y));
  const InvalidSamples& invalid = s.counters.invalid;
  EXPECT_GT(invalid.of(InvalidTerm::kEmission), 0u);
  EXPECT_GT(invalid.of(InvalidTerm::kLight), 0u);
  EXPECT_EQ(invalid.total(), invalid.of(InvalidTerm::kEmission) + invalid.of(InvalidTerm::kLight));
  EXPECT_EQ(invalid.first, (InvalidPlace{0, 0, 0, InvalidTerm::kLight})) << "of the first vertex";
}

}  // namespace
}  // namespace shoal
