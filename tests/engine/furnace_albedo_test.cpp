// Energy: directional albedos by integration over the hemisphere, independent of the sampler (the white furnace).
#include <gtest/gtest.h>

#include <cmath>

#include "engine/bsdf.h"
#include "engine/math.h"

namespace shoal {
namespace {

constexpr Vec3 kUp(0, 0, 1);

const EnergyTable& table() {
  static const EnergyTable instance;
  return instance;
}

Vec3 view(float mu) { return {std::sqrt(1 - mu * mu), 0, mu}; }

/// Integral of f cos over the hemisphere in double, with nodes that crowd around the mirror direction: the half
/// vector's slope is warped by the lobe's own width, by a formula that shares nothing with Bsdf::sample().
Vec3 albedo(const Bsdf& bsdf, float mu, float alpha, int steps = 220) {
  const glm::dvec3 wo(view(mu));
  glm::dvec3 sum(0);
  for (int i = 0; i < steps; ++i) {
    // tan(theta_h) = alpha * s / (1 - s) covers every half vector; s is cubed towards 1 for grazing ones.
    const double x = (i + 0.5) / steps, s = 1 - (1 - x) * (1 - x), ds = 2 * (1 - x) / steps;
    const double tangent = alpha * s / (1 - s), dtangent = alpha / ((1 - s) * (1 - s)) * ds;
    const double cosine = 1 / std::sqrt(1 + tangent * tangent), sine = tangent * cosine;
    const double dtheta = dtangent * cosine * cosine;
    for (int k = 0; k < 2 * steps; ++k) {
      const double phi = M_PI * (k + 0.5) / (2 * steps), dphi = M_PI / (2 * steps);
      const glm::dvec3 h(sine * std::cos(phi), sine * std::sin(phi), cosine);
      const double oh = glm::dot(wo, h);
      if (oh <= 0) continue;
      const glm::dvec3 wi = 2 * oh * h - wo;
      if (wi.z <= 0) continue;
      const double solid_angle = 4 * oh * sine * dtheta * dphi;  // dwi = 4 (wo.h) dh (Walter et al. 2007, eq. 14)
      sum += glm::dvec3(bsdf.evaluate(Vec3(wi)).value) * (2 * solid_angle);
    }
  }
  return Vec3(sum);
}

Vec3 material_albedo(const MaterialSample& material, float mu) {
  const float alpha = std::max(kMinAlpha, material.roughness * material.roughness);
  const Bsdf bsdf(material, &table(), kUp, kUp, view(mu));
  return albedo(bsdf, mu, material.has_specular_lobe() ? alpha : 1.0f);
}

TEST(Furnace, AWhiteMetalReflectsEverythingAtEveryRoughnessAndAngle) {
  for (const float roughness : {0.0f, 0.05f, 0.1f, 0.2f, 0.33f, 0.5f, 0.71f, 0.9f, 1.0f}) {
    for (const float mu : {0.05f, 0.11f, 0.3f, 0.6f, 0.85f, 0.999f}) {
      MaterialSample metal;
      metal.metallic = 1, metal.roughness = roughness;
      EXPECT_NEAR(material_albedo(metal, mu).x, 1, 0.005) << "roughness " << roughness << ", mu " << mu;
    }
  }
}

TEST(Furnace, AWhiteLambertianReflectsEverything) {
  MaterialSample white;
  white.specular = 0;
  for (const float mu : {0.05f, 0.5f, 1.0f}) EXPECT_NEAR(material_albedo(white, mu).y, 1, 0.002) << mu;
}

TEST(Furnace, NoMixtureGainsEnergy) {
  for (const float metallic : {0.0f, 0.3f, 0.8f}) {
    for (const float roughness : {0.02f, 0.3f, 0.6f, 1.0f}) {
      for (const float f0 : {0.04f, 0.17f, 1.0f}) {
        for (const float specular : {0.4f, 1.0f}) {
          for (const float mu : {0.06f, 0.4f, 0.95f}) {
            const MaterialSample m{Vec3(1), metallic, roughness, specular, Vec3(0.5f, 1, 3), f0};
            EXPECT_LE(max_component(material_albedo(m, mu)), 1.005f)
                << "metallic " << metallic << ", roughness " << roughness << ", f0 " << f0 << ", specular "
                << specular << ", mu " << mu;
          }
        }
      }
    }
  }
}

TEST(Furnace, AWhitePlasticLosesLittle) {
  // The diffuse part takes what the coat leaves: exactly one for a grey coat, by construction.
  for (const float mu : {0.1f, 0.5f, 0.9f}) {
    EXPECT_NEAR(material_albedo(MaterialSample{Vec3(1), 0, 0.5f, 1, Vec3(1), 0.04f}, mu).x, 1, 0.005) << mu;
  }
}

TEST(Furnace, TheTableAgreesWithAFineIntegral) {
  for (const float alpha : {0.001f, 0.0033f, 0.02f, 0.1f, 0.37f, 0.72f, 1.0f}) {
    for (const float mu : {0.002f, 0.01f, 0.05f, 0.2f, 0.55f, 0.97f}) {
      const SpecularAlbedo fine = integrate_specular_albedo(mu, alpha, 200), found = table().albedo(mu, alpha);
      EXPECT_NEAR(found.total(), fine.total(), 0.003) << alpha << " " << mu;
      EXPECT_NEAR(found.b, fine.b, 0.003) << alpha << " " << mu;
    }
  }
}

}  // namespace
}  // namespace shoal
