// The BSDF's three faces must agree: what sample() draws, what pdf says, what evaluate() returns.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "engine/bsdf.h"
#include "engine/sampler.h"

namespace shoal {
namespace {

const EnergyTable& table() {
  static const EnergyTable instance;
  return instance;
}

const Vec3 kNormal = glm::normalize(Vec3(0.3f, -0.5f, 0.7f));

Vec3 view(float mu) { return Frame(kNormal).to_world({0, std::sqrt(1 - mu * mu), mu}); }

struct Case {
  MaterialSample material;
  float mu;
};
std::vector<Case> cases() {
  return {{{Vec3(0.8f), 0, 0.5f, 0, Vec3(1), 0.04f}, 0.6f},
          {{Vec3(0.8f), 1, 0.6f, 1, Vec3(1), 0.04f}, 0.9f},
          {{Vec3(0.9f), 1, 1.0f, 1, Vec3(1), 0.04f}, 0.2f},
          {{Vec3(0.5f), 0, 0.7f, 1, Vec3(1), 0.04f}, 0.4f},
          {{Vec3(0.7f), 0.5f, 0.8f, 1, Vec3(1), 0.1f}, 0.7f}};
}

BsdfSample draw(const Bsdf& bsdf, uint32_t i, uint32_t stream) {
  const Random4 r = random4(99, i, stream, 0, Dimension::kBsdf);
  return bsdf.sample(r.uniform(0), r.uniform(1), r.uniform(2));
}

/// Bins on the hemisphere, equal in cos(theta) and phi.
constexpr int kRows = 12, kColumns = 24;

TEST(BsdfSampling, DrawsDirectionsWithTheDensityItReports) {
  constexpr uint32_t kDraws = 200000;
  uint32_t stream = 0;
  for (const Case& c : cases()) {
    const Bsdf bsdf(c.material, &table(), kNormal, kNormal, view(c.mu));
    const Frame frame(kNormal);
    std::array<double, kRows * kColumns> expected{}, drawn{};
    constexpr int kFine = 24;
    for (int y = 0; y < kRows * kFine; ++y) {
      for (int x = 0; x < kColumns * kFine; ++x) {
        const float z = (static_cast<float>(y) + 0.5f) / (kRows * kFine), r = std::sqrt(1 - z * z);
        const float phi = 2 * kPi * (static_cast<float>(x) + 0.5f) / (kColumns * kFine);
        const Vec3 wi = frame.to_world({r * std::cos(phi), r * std::sin(phi), z});
        expected[y / kFine * kColumns + x / kFine] +=
            bsdf.evaluate(wi).pdf * (2.0 * kPi) / (kRows * kFine * kColumns * kFine);
      }
    }
    for (uint32_t i = 0; i < kDraws; ++i) {
      const BsdfSample s = draw(bsdf, i, stream);
      if (s.pdf == 0) continue;
      const Vec3 local = frame.to_local(s.direction);
      double phi = std::atan2(local.y, local.x);
      if (phi < 0) phi += 2 * M_PI;
      const int y = std::min(kRows - 1, static_cast<int>(local.z * kRows));
      const int x = std::min(kColumns - 1, static_cast<int>(phi / (2 * M_PI) * kColumns));
      drawn[y * kColumns + x] += 1;
    }
    double chi2 = 0, integral = 0;
    int freedom = 0;
    for (size_t i = 0; i < expected.size(); ++i) {
      integral += expected[i];
      const double e = expected[i] * kDraws;
      if (e < 5) continue;
      chi2 += (drawn[i] - e) * (drawn[i] - e) / e, ++freedom;
    }
    EXPECT_LE(integral, 1.002) << "case " << stream;
    EXPECT_LT(chi2, freedom + 6 * std::sqrt(2.0 * freedom)) << "case " << stream;
    ++stream;
  }
}

TEST(BsdfSampling, WeightsEstimateTheIntegral) {
  uint32_t stream = 100;
  for (const Case& c : cases()) {
    const Bsdf bsdf(c.material, &table(), kNormal, kNormal, view(c.mu));
    constexpr uint32_t kDraws = 200000;
    double sampled = 0, integral = 0;
    for (uint32_t i = 0; i < kDraws; ++i) sampled += draw(bsdf, i, stream).weight.y / kDraws;
    constexpr int kFine = 400;
    for (int y = 0; y < kFine; ++y) {
      for (int x = 0; x < kFine; ++x) {
        const float z = (static_cast<float>(y) + 0.5f) / kFine, r = std::sqrt(1 - z * z);
        const float phi = 2 * kPi * (static_cast<float>(x) + 0.5f) / kFine;
        integral += bsdf.evaluate(Frame(kNormal).to_world({r * std::cos(phi), r * std::sin(phi), z})).value.y *
                    (2.0 * kPi) / (kFine * kFine);
      }
    }
    EXPECT_NEAR(sampled, integral, 0.005) << "case " << stream;
    ++stream;
  }
}

TEST(BsdfSampling, TheReportedDensityAndWeightAreThoseOfEvaluate) {
  for (const Case& c : cases()) {
    const Bsdf bsdf(c.material, &table(), kNormal, kNormal, view(c.mu));
    for (uint32_t i = 0; i < 2000; ++i) {
      const BsdfSample s = draw(bsdf, i, 7);
      if (s.pdf == 0) continue;
      const BsdfValue v = bsdf.evaluate(s.direction);
      EXPECT_NEAR(v.pdf / s.pdf, 1, 1e-3);
      EXPECT_NEAR(v.value.x / v.pdf, s.weight.x, 1e-3);
    }
  }
}

TEST(BsdfSampling, TheSmoothestLobeIsStillConsistent) {
  MaterialSample mirror;
  mirror.metallic = 1, mirror.roughness = 0;
  for (const float mu : {0.05f, 0.5f, 1.0f}) {
    const Bsdf bsdf(mirror, &table(), kNormal, kNormal, view(mu));
    double sum = 0;
    for (uint32_t i = 0; i < 4000; ++i) {
      const BsdfSample s = draw(bsdf, i, 11);
      ASSERT_TRUE(std::isfinite(s.weight.x));
      sum += s.weight.x / 4000;
      if (s.pdf == 0) continue;
      EXPECT_NEAR(bsdf.evaluate(s.direction).pdf / s.pdf, 1, 0.05) << mu;  // rounding to world space and back
    }
    EXPECT_NEAR(sum, 1, 0.005) << mu;
  }
}

TEST(BsdfSampling, ALambertianIsExactAndNeedsNoTable) {
  MaterialSample matte;
  matte.base_color = {0.2f, 0.5f, 0.9f}, matte.specular = 0;
  const Bsdf bsdf(matte, nullptr, kNormal, kNormal, view(0.3f));
  for (uint32_t i = 0; i < 1000; ++i) {
    const BsdfSample s = draw(bsdf, i, 3);
    const float cosine = glm::dot(kNormal, s.direction);
    for (int c = 0; c < 3; ++c) {
      EXPECT_FLOAT_EQ(s.weight[c], matte.base_color[c]);
      EXPECT_NEAR(bsdf.evaluate(s.direction).value[c], matte.base_color[c] * cosine / kPi, 1e-6f);
    }
  }
}

TEST(BsdfSampling, NothingPassesThroughTheSurface) {
  const Vec3 shading = glm::normalize(kNormal + 0.8f * Frame(kNormal).x);
  for (const Case& c : cases()) {
    const Bsdf bsdf(c.material, &table(), kNormal, shading, glm::normalize(kNormal + 0.2f * Frame(kNormal).y));
    for (uint32_t i = 0; i < 5000; ++i) {
      const BsdfSample s = draw(bsdf, i, 5);
      EXPECT_TRUE(s.pdf == 0 || glm::dot(s.direction, kNormal) > 0);
      const Vec3 below = Frame(-kNormal).to_world(
          sample_cosine_hemisphere(static_cast<float>(i) / 5000, static_cast<float>(i * 7 % 5000) / 5000));
      EXPECT_EQ(bsdf.evaluate(below).value, Vec3(0));
    }
  }
}

TEST(BsdfSampling, AViewFromBehindOrABlackSurfaceIsBlack) {
  MaterialSample black;
  black.base_color = Vec3(0), black.specular = 0;
  EXPECT_TRUE(Bsdf(black, &table(), kNormal, kNormal, view(0.5f)).black());
  EXPECT_TRUE(Bsdf(MaterialSample{}, &table(), kNormal, kNormal, -view(0.5f)).black());
  EXPECT_EQ(Bsdf(black, &table(), kNormal, kNormal, view(0.5f)).sample(0.5f, 0.5f, 0.5f).pdf, 0);
}

}  // namespace
}  // namespace shoal
