// The knobs that change what a path brings: limits of contributions, and where Russian roulette begins.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "engine/render.h"
#include "tests/support/shading_scene.h"

namespace shoal {
namespace {

using namespace testing;

const Vec3 kEye(0.3f, 0.5f, -7);
const Vec3 kDown = glm::normalize(-kEye);

/// A small bright lamp close to a floor, and a white wall that sends its light on: few paths bring much.
ShadingScene bright_corner() {
  TriangleSoup soup;
  add_rectangle(soup, {-20, 0, -20}, {40, 0, 0}, {0, 0, 40}, 0);
  add_rectangle(soup, {-20, -1, 2}, {0, 20, 0}, {40, 0, 0}, 0);
  add_rectangle(soup, {-0.1f, 0.2f, 1.5f}, {0.2f, 0, 0}, {0, 0, 0.2f}, 1);
  return ShadingScene(std::move(soup), {matte(Vec3(0.9f, 0.8f, 0.5f)), lamp(Vec3(400, 300, 200))});
}

ShadingOptions with_bounces(uint32_t bounces) {
  ShadingOptions options;
  options.bounces = bounces;
  return options;
}

float largest(const Vec3& v) { return std::max(v.x, std::max(v.y, v.z)); }

struct Paths {
  std::vector<Vec3> radiance;
  uint64_t clamped_count = 0;
  double mean() const {
    double sum = 0;
    for (const Vec3& r : radiance) sum += r.y;
    return sum / static_cast<double>(radiance.size());
  }
  double variance_of_mean() const {
    const double m = mean();
    double sum = 0;
    for (const Vec3& r : radiance) sum += (r.y - m) * (r.y - m);
    return sum / static_cast<double>(radiance.size()) / static_cast<double>(radiance.size());
  }
};

/// Independent samples, so that the variance of their mean is known.
Paths paths_of(ShadingScene& s, ShadingOptions options, uint32_t count = 4000) {
  options.sampler = SamplerKind::kIndependent;
  s.prepare(options);
  s.counters = {};
  Paths paths;
  for (uint32_t i = 0; i < count; ++i) paths.radiance.push_back(s.radiance(kEye, kDown, i, 0));
  paths.clamped_count = s.counters.clamped_samples_count;
  return paths;
}

TEST(ClampedContributions, DirectLightStopsAtItsLimitAndKeepsItsHue) {
  ShadingScene s = bright_corner();
  const Paths free = paths_of(s, with_bounces(1));
  ShadingOptions options = with_bounces(1);
  options.clamp_direct = 0.5f * static_cast<float>(free.mean());
  const Paths clamped = paths_of(s, options);
  EXPECT_EQ(free.clamped_count, 0u);
  EXPECT_GT(clamped.clamped_count, 100u);
  EXPECT_LT(clamped.mean(), free.mean()) << "the bias is towards dark";
  uint32_t lowered = 0;
  for (size_t i = 0; i < free.radiance.size(); ++i) {
    const Vec3 before = free.radiance[i], after = clamped.radiance[i];
    // Two contributions at most: the light sample, and the lamp that the bounce may find.
    EXPECT_LE(largest(after), 2.0001f * options.clamp_direct);
    EXPECT_LE(largest(after), largest(before) * 1.0001f);
    if (largest(after) < 0.99f * largest(before)) ++lowered;
    EXPECT_NEAR(after.x * before.y, after.y * before.x, 1e-4f * before.x * before.y) << "another hue";
  }
  EXPECT_GT(lowered, 100u);
}

TEST(ClampedContributions, WhatIsUnderTheLimitHasTheSameBits) {
  ShadingScene s = bright_corner();
  const Paths free = paths_of(s, with_bounces(4), 500);
  ShadingOptions options = with_bounces(4);
  options.clamp_direct = options.clamp_indirect = 1e6f;
  const Paths high = paths_of(s, options, 500);
  EXPECT_EQ(high.clamped_count, 0u);
  EXPECT_EQ(high.radiance, free.radiance);
}

TEST(ClampedContributions, DirectAndIndirectLightHaveLimitsOfTheirOwn) {
  ShadingScene s = bright_corner();
  const Paths direct = paths_of(s, with_bounces(1)), all = paths_of(s, with_bounces(4));
  ShadingOptions options = with_bounces(4);
  options.clamp_indirect = 1e-6f;
  const Paths no_indirect = paths_of(s, options);
  ASSERT_GT(all.mean(), 1.01 * direct.mean()) << "nothing to take away";
  EXPECT_NEAR(no_indirect.mean(), direct.mean(), 1e-4 * direct.mean()) << "only direct light is left";
  options.clamp_indirect = 0, options.clamp_direct = 1e-6f;
  const Paths no_direct = paths_of(s, options);
  EXPECT_NEAR(no_direct.mean(), all.mean() - direct.mean(), 1e-3 * all.mean());
}

TEST(ClampedContributions, LightThatIsSeenDirectlyHasNoLimit) {
  ShadingScene s = bright_corner();
  ShadingOptions options = with_bounces(2);
  options.clamp_direct = options.clamp_indirect = 0.01f;
  s.prepare(options);
  EXPECT_EQ(s.radiance({0, 5, 1.6f}, {0, -1, 0}, 0, 0), Vec3(400, 300, 200));
}

TEST(ClampedContributions, LimitsThatAreNoNumbersAreRefused) {
  for (const float limit : {-1.0f, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    PictureOptions picture;
    picture.shading.clamp_direct = limit;
    EXPECT_FALSE(check_picture(picture).ok()) << limit;
    picture = {};
    picture.shading.clamp_indirect = limit;
    EXPECT_FALSE(check_picture(picture).ok()) << limit;
  }
  EXPECT_TRUE(check_picture({}).ok());
}

TEST(Roulette, EndsPathsFromItsStartOnAndChangesNoMean) {
  // Between two wide plates, one of which glows: no path leaves.
  TriangleSoup soup;
  add_rectangle(soup, {-500, -1, -500}, {1000, 0, 0}, {0, 0, 1000}, 0);
  add_rectangle(soup, {-500, 1, -500}, {1000, 0, 0}, {0, 0, 1000}, 1);
  Material glowing = lamp(Vec3(1));
  for (float& c : glowing.base_color) c = 0.6f;
  ShadingScene s(std::move(soup), {matte(Vec3(0.5f)), glowing});
  const auto shaded = [&](uint32_t start) {
    ShadingOptions options = with_bounces(12);
    options.roulette_start = start;
    options.seed = start;  // of their own, so that the means are independent
    const Paths paths = paths_of(s, options, 8000);
    return std::pair(paths, s.counters.vertices_shaded_count);
  };
  const auto [never, vertices_never] = shaded(ShadingOptions::kNoRoulette);
  const auto [late, vertices_late] = shaded(3);
  const auto [always, vertices_always] = shaded(0);
  EXPECT_LT(vertices_late, 0.7 * static_cast<double>(vertices_never)) << "it saves work";
  EXPECT_LT(vertices_always, 0.7 * static_cast<double>(vertices_late));
  for (const Paths& paths : {late, always}) {
    EXPECT_NEAR(paths.mean(), never.mean(), 4 * std::sqrt(paths.variance_of_mean() + never.variance_of_mean()));
    EXPECT_LT(std::sqrt(paths.variance_of_mean()), 0.05 * never.mean()) << "too noisy to tell";
  }
}

}  // namespace
}  // namespace shoal
