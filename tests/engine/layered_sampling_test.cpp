// The layered BSDF's three faces must agree over the whole sphere: what sample() draws, what pdf says, what
// evaluate() returns. And without layers it must be the plain one, to the bit.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "tests/support/layered_cases.h"

namespace shoal {
namespace {

using namespace testing;

constexpr int kRows = 24, kColumns = 24;  // equal in cos(theta) and phi

int bin_of(const Vec3& d) {
  double phi = std::atan2(d.y, d.x);
  if (phi < 0) phi += 2 * M_PI;
  const int y = std::clamp(static_cast<int>((d.z + 1) * 0.5f * kRows), 0, kRows - 1);
  return y * kColumns + std::min(kColumns - 1, static_cast<int>(phi / (2 * M_PI) * kColumns));
}

/// What the density promises and what is drawn, by bins of the sphere.
void expect_drawn_as_promised(const LayeredBsdf& bsdf, uint32_t stream, const std::string& what) {
  constexpr uint32_t kDraws = 100000;
  constexpr int kFine = 20;
  std::array<double, kRows * kColumns> expected{}, drawn{};
  for (int y = 0; y < kRows * kFine; ++y) {
    for (int x = 0; x < kColumns * kFine; ++x) {
      const double z = 2 * (y + 0.5) / (kRows * kFine) - 1, r = std::sqrt(1 - z * z);
      const double phi = 2 * M_PI * (x + 0.5) / (kColumns * kFine);
      expected[static_cast<size_t>(y / kFine * kColumns + x / kFine)] +=
          bsdf.evaluate({r * std::cos(phi), r * std::sin(phi), z}).pdf * (4 * M_PI) /
          (kRows * kFine * kColumns * kFine);
    }
  }
  for (uint32_t i = 0; i < kDraws; ++i) {
    const BsdfSample s = draw(bsdf, i, stream);
    if (s.pdf > 0) drawn[static_cast<size_t>(bin_of(s.direction))] += 1;
  }
  double chi2 = 0, integral = 0;
  int freedom = 0;
  for (size_t i = 0; i < expected.size(); ++i) {
    integral += expected[i];
    const double e = expected[i] * kDraws;
    if (e < 5) continue;
    chi2 += (drawn[i] - e) * (drawn[i] - e) / e, ++freedom;
  }
  EXPECT_LE(integral, 1.01) << what;
  EXPECT_LT(chi2, freedom + 6 * std::sqrt(2.0 * freedom)) << what;
}

TEST(LayeredSampling, DrawsDirectionsWithTheDensityItReportsOverTheWholeSphere) {
  uint32_t stream = 0;
  for (const float roughness : {0.5f, 1.0f}) {
    for (const LayeredCase& c : layered_cases(roughness)) {
      if (c.name == "volume that bends nothing") continue;  // passes within a milliradian, whatever the roughness
      for (const float mu : {0.2f, 0.6f, 0.95f}) {
        const LayeredBsdf bsdf(c.material, lobe_tables(), kUp, kUp, view(mu));
        expect_drawn_as_promised(bsdf, stream++, fmt::format("{}, roughness {}, mu {}", c.name, roughness, mu));
      }
    }
  }
}

TEST(LayeredSampling, DrawsAsItReportsWhereNormalsDifferAndLobesEndAtTheSurface) {
  // A mapped normal under a coat that has the vertices' or one of its own: what a lobe draws on the wrong side of the
  // surface is no direction, whatever another lobe would make of it.
  uint32_t stream = 1000;
  const Vec3 mapped = glm::normalize(Vec3(0.45f, 0, 1)), other = glm::normalize(Vec3(-0.3f, 0.3f, 1));
  for (LayeredCase c : layered_cases(0.6f)) {
    if (c.name == "volume that bends nothing") continue;
    c.material.clearcoat = 0.8f, c.material.clearcoat_roughness = 0.5f;
    for (const Vec3& coat : {kUp, other}) {
      c.material.clearcoat_normal = coat;
      for (const float mu : {0.35f, 0.9f}) {
        const LayeredBsdf bsdf(c.material, lobe_tables(), kUp, mapped, view(mu));
        expect_drawn_as_promised(bsdf, stream++, fmt::format("{}, coated, mu {}", c.name, mu));
      }
    }
  }
}

TEST(LayeredSampling, TheReportedDensityAndWeightAreThoseOfEvaluate) {
  for (const float roughness : {0.3f, 0.8f}) {
    for (const LayeredCase& c : layered_cases(roughness)) {
      const LayeredBsdf bsdf(c.material, lobe_tables(), kUp, kUp, view(0.4f));
      for (uint32_t i = 0; i < 2000; ++i) {
        const BsdfSample s = draw(bsdf, i, 7);
        if (s.pdf == 0) continue;
        const BsdfValue v = bsdf.evaluate(s.direction);
        EXPECT_NEAR(v.pdf / s.pdf, 1, 5e-3) << c.name;
        EXPECT_NEAR(v.value.x / v.pdf, s.weight.x, 5e-3 * std::max(1.0f, s.weight.x)) << c.name;
      }
    }
  }
}

TEST(LayeredSampling, TheSmoothestLobesSendBackAndThroughWhatTheyShould) {
  // Nearly a mirror: refraction by Snell's law, thin walls straight on.
  const Vec3 wo = view(0.7f);
  const float sine_t = std::sqrt(1 - 0.49f) / 1.5f;
  const LayeredBsdf glass(white_glass(0, 1.5f, true), lobe_tables(), kUp, kUp, wo);
  LayeredSample m = white_plastic(0);
  m.transmission = 1;
  const LayeredBsdf pane(m, lobe_tables(), kUp, kUp, wo);
  int through = 0;
  for (uint32_t i = 0; i < 2000; ++i) {
    const BsdfSample s = draw(glass, i, 1), t = draw(pane, i, 1);
    ASSERT_TRUE(std::isfinite(s.weight.x) && std::isfinite(t.weight.x));
    if (s.pdf > 0 && s.direction.z < 0) {
      EXPECT_NEAR(std::sqrt(1 - s.direction.z * s.direction.z), sine_t, 0.02);
      ++through;
    }
    if (t.pdf > 0 && t.direction.z < 0) {
      EXPECT_NEAR(glm::dot(t.direction, -wo), 1, 0.01);
    }
  }
  EXPECT_GT(through, 1700);
}

TEST(LayeredSampling, BeyondTheCriticalAngleEverythingIsReflected) {
  const LayeredBsdf glass(white_glass(0, 1.5f, false), lobe_tables(), kUp, kUp, view(0.5f));  // critical: 0.745
  for (uint32_t i = 0; i < 1000; ++i) {
    const BsdfSample s = draw(glass, i, 1);
    EXPECT_TRUE(s.pdf == 0 || s.direction.z > 0);
  }
}

/// f of the specular, sheen and thin lobes does not change when the directions are swapped; layers that are scaled
/// by wo's albedo alone do, and so does the compensation: measured without both.
TEST(LayeredSampling, LobesWithASymmetricFormulaAreReciprocal) {
  const Vec3 a = view(0.8f, 0.3f), b = view(0.35f, 2.0f);
  const Sheen sheen{0.4f};
  EXPECT_NEAR(sheen.value(a, b) / b.z, sheen.value(b, a) / a.z, 1e-5f);
  const GgxAnisotropic ggx = anisotropic_ggx(0.2f, 0.7f);
  const Vec3 h = glm::normalize(a + b);
  const float forth = ggx.d(h) / (4 * a.z * (1 + ggx.lambda(a) + ggx.lambda(b))) / b.z;
  const float back = ggx.d(h) / (4 * b.z * (1 + ggx.lambda(b) + ggx.lambda(a))) / a.z;
  EXPECT_NEAR(forth, back, 1e-5f * forth);
  // What passes a thin wall, below a surface that reflects nothing; rough so little that nothing is compensated.
  LayeredSample wall = white_plastic(0.15f), paper = white_plastic(0.8f);
  wall.specular = paper.specular = 0, wall.transmission = 1, paper.diffuse_transmission = 0.6f;
  const Vec3 near_a = glm::normalize(Vec3(-a.x + 0.01f, -a.y, -a.z)), flipped = near_a * Vec3(1, 1, -1);
  for (const LayeredSample& m : {wall, paper}) {
    const float there = LayeredBsdf(m, lobe_tables(), kUp, kUp, a).evaluate(near_a).value.x / -near_a.z;
    const float again =
        LayeredBsdf(m, lobe_tables(), kUp, kUp, flipped).evaluate(a * Vec3(1, 1, -1)).value.x / a.z;
    EXPECT_GT(there, 0);
    EXPECT_NEAR(there / again, 1, 2e-3);
  }
  // Refraction: f(a, b) / eta^2 = f(b, a) for what carries L / n^2 (Veach 1997, eq. 5.14), at a roughness where the
  // compensation is 1 to 0.1 %.
  const float eta = 1.5f;
  const LayeredBsdf in(white_glass(0.15f, eta, true), lobe_tables(), kUp, kUp, a);
  for (uint32_t i = 0; i < 200; ++i) {
    const BsdfSample s = draw(in, i, 3);
    if (s.pdf == 0 || s.direction.z > -0.3f) continue;
    const Vec3 flip(1, 1, -1);
    const LayeredBsdf out(white_glass(0.15f, eta, false), lobe_tables(), kUp, kUp, s.direction * flip);
    const float forward = in.evaluate(s.direction).value.x / -s.direction.z / (eta * eta);
    const float backward = out.evaluate(a * flip).value.x / a.z;
    EXPECT_NEAR(forward / backward, 1, 0.02) << i;
  }
}

TEST(LayeredSampling, WithoutLayersItIsThePlainBsdfToTheBit) {
  const Vec3 normal = glm::normalize(Vec3(0.3f, -0.5f, 0.7f));
  for (const MaterialSample& plain :
       {MaterialSample{Vec3(0.8f), 0, 0.5f, 0, Vec3(1), 0.04f},
        MaterialSample{Vec3(0.8f), 1, 0.6f, 1, Vec3(1), 0.04f},
        MaterialSample{Vec3(0.9f, 0.3f, 0.1f), 0.4f, 0.3f, 0.7f, Vec3(1, 2, 0.5f), 0.1f},
        MaterialSample{Vec3(0.5f), 0, 0.0f, 1, Vec3(1), 0.04f}}) {
    LayeredSample layered;
    static_cast<MaterialSample&>(layered) = plain;
    layered.clearcoat_normal = normal;
    for (const float mu : {0.1f, 0.5f, 0.99f}) {
      const Vec3 wo = Frame(normal).to_world(view(mu));
      const Bsdf a(plain, lobe_tables().energy, normal, normal, wo);
      const LayeredBsdf b(layered, lobe_tables(), normal, normal, wo);
      EXPECT_EQ(a.black(), b.black());
      for (uint32_t i = 0; i < 2000; ++i) {
        const Random4 r = random4(99, i, 3, 0, Dimension::kBsdf);
        const BsdfSample s = a.sample(r.uniform(0), r.uniform(1), r.uniform(2)), t = draw(b, i, 3);
        ASSERT_EQ(s.direction, t.direction);
        ASSERT_EQ(s.weight, t.weight);
        ASSERT_EQ(s.pdf, t.pdf);
        const Vec3 wi = Frame(normal).to_world(sample_cosine_hemisphere(r.uniform(1), r.uniform(2)));
        ASSERT_EQ(a.evaluate(wi).value, b.evaluate(wi).value);
        ASSERT_EQ(a.evaluate(wi).pdf, b.evaluate(wi).pdf);
      }
    }
  }
}

TEST(LayeredSampling, AViewFromBehindIsBlack) {
  for (const LayeredCase& c : layered_cases(0.5f)) {
    const LayeredBsdf bsdf(c.material, lobe_tables(), kUp, kUp, -view(0.5f));
    EXPECT_TRUE(bsdf.black()) << c.name;
    EXPECT_EQ(bsdf.sample(0.5f, 0.5f, 0.5f).pdf, 0);
  }
}

}  // namespace
}  // namespace shoal
