// The white furnace over layers: nothing gains energy at any roughness, index and angle, and single lobes with
// compensation lose next to none. By the mean weight of drawn directions, which layered_sampling_test holds to
// their density, and for the tables by finer integrals.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/thin_film.h"
#include "tests/support/layered_cases.h"

namespace shoal {
namespace {

using namespace testing;

/// Mean weight of draws, one in each cell of the cube of random numbers: what the surface sends out of what comes from
/// wo. Error about 0.1 % of 1.
Vec3 albedo(const LayeredSample& m, float mu, float phi = 0.6f) {
  constexpr uint32_t kCells = 40;
  const LayeredBsdf bsdf(m, lobe_tables(), kUp, kUp, view(mu, phi));
  glm::dvec3 sum(0);
  for (uint32_t i = 0; i < kCells * kCells * kCells; ++i) {
    const Random4 r = random4(17, i, 0, 0, Dimension::kBsdf);
    const auto in_cell = [](uint32_t cell, float u) {
      return std::min((static_cast<float>(cell) + u) / static_cast<float>(kCells), 0x1.fffffep-1f);
    };
    sum += glm::dvec3(bsdf.sample(in_cell(i % kCells, r.uniform(0)), in_cell(i / kCells % kCells, r.uniform(1)),
                                  in_cell(i / (kCells * kCells), r.uniform(2)))
                          .weight);
  }
  return Vec3(sum / static_cast<double>(kCells * kCells * kCells));
}

constexpr float kAngles[] = {0.06f, 0.3f, 0.7f, 0.98f};
/// Of the mean of the draws (0.1 %) and of tables that are read between their nodes (0.4 %).
constexpr float kError = 0.005f;

TEST(LayeredFurnace, NothingGainsEnergyAtAnyRoughnessIndexAndAngle) {
  for (const float roughness : {0.05f, 0.3f, 0.6f, 0.85f, 1.0f}) {
    for (const LayeredCase& c : layered_cases(roughness)) {
      for (const float mu : kAngles) {
        EXPECT_LE(max_component(albedo(c.material, mu)), 1 + kError)
            << c.name << ", roughness " << roughness << ", mu " << mu;
      }
    }
  }
}

TEST(LayeredFurnace, WhiteGlassKeepsEverythingAtAnyRoughnessIndexAndAngle) {
  for (const float roughness : {0.0f, 0.2f, 0.45f, 0.7f, 1.0f}) {
    for (const float ior : {1.1f, 1.33f, 1.5f, 2.4f}) {
      for (const bool outside : {true, false}) {
        for (const float mu : kAngles) {
          EXPECT_NEAR(albedo(white_glass(roughness, ior, outside), mu).x, 1, kError)
              << "roughness " << roughness << ", index " << ior << (outside ? "" : ", inside") << ", mu " << mu;
        }
      }
    }
  }
}

TEST(LayeredFurnace, SingleLobesWithCompensationLoseLessThanHalfAPercent) {
  for (const float roughness : {0.05f, 0.3f, 0.6f, 1.0f}) {
    for (const float mu : kAngles) {
      LayeredSample thin = white_plastic(roughness), paper = thin, brushed = white_metal(roughness);
      thin.transmission = 1;
      EXPECT_NEAR(albedo(thin, mu).x, 1, kError) << "thin, roughness " << roughness << ", mu " << mu;
      paper.diffuse_transmission = 1;
      EXPECT_NEAR(albedo(paper, mu).x, 1, kError) << "paper, roughness " << roughness << ", mu " << mu;
      LayeredSample coated = white_metal(0.5f);
      coated.clearcoat = 1, coated.clearcoat_roughness = roughness;
      EXPECT_NEAR(albedo(coated, mu).x, 1, kError) << "coat, roughness " << roughness << ", mu " << mu;
      for (const float strength : {0.4f, 1.0f}) {
        for (const float phi : {0.1f, 0.8f, 1.5f}) {
          brushed.anisotropy = strength;
          EXPECT_NEAR(albedo(brushed, mu, phi).x, 1, kError)
              << "brushed " << strength << ", roughness " << roughness << ", mu " << mu << ", phi " << phi;
        }
      }
    }
  }
}

TEST(LayeredFurnace, SheenTakesFromBelowWhatItReflects) {
  for (const float roughness : {0.1f, 0.3f, 0.6f, 1.0f}) {
    for (const float mu : kAngles) {
      LayeredSample velvet = white_plastic(0.8f);
      velvet.sheen_color = Vec3(1), velvet.sheen_roughness = roughness;
      EXPECT_NEAR(albedo(velvet, mu).x, 1, kError) << "roughness " << roughness << ", mu " << mu;
    }
  }
}

TEST(LayeredFurnace, TheTablesAgreeWithFineIntegrals) {
  for (const float alpha : {0.001f, 0.02f, 0.15f, 0.5f, 0.9f}) {
    for (const float mu : {0.06f, 0.2f, 0.55f, 0.97f}) {
      for (const float eta : {1.05f, 1.4f, 2.2f, 1 / 1.2f, 1 / 1.5f, 1 / 2.4f}) {
        const GlassAlbedo fine = integrate_glass_albedo(mu, alpha, eta, 20000);
        const GlassAlbedo found = lobe_tables().glass->albedo(mu, alpha, eta);
        EXPECT_NEAR(found.sum(0.04f, 1), fine.sum(0.04f, 1), 0.003) << alpha << " " << mu << " " << eta;
      }
      for (const float phi : {0.2f, 0.9f}) {
        for (const float strength : {0.3f, 0.77f}) {
          const GgxAnisotropic ggx = anisotropic_ggx(alpha, strength);
          const SpecularAlbedo fine = integrate_anisotropic_albedo(view(mu, phi), ggx, 20000);
          const SpecularAlbedo found = lobe_tables().anisotropy->albedo(view(mu, phi), ggx);
          EXPECT_NEAR(found.total(), fine.total(), 0.004) << alpha << " " << mu << " " << phi << " " << strength;
        }
      }
      const float fibre = std::max(alpha, kMinSheenAlpha);
      EXPECT_NEAR(lobe_tables().sheen->albedo(mu, fibre), integrate_sheen_albedo(mu, fibre, 300), 0.002)
          << fibre << " " << mu;
    }
  }
}

TEST(LayeredFurnace, AnyNumberOfThreadsMakesTheSameTables) {
  const SheenTable sheen(3);
  const GlassTable one({1.5f}, 1), three({1.5f}, 3);
  for (const float mu : {0.01f, 0.3f, 0.77f, 1.0f}) {
    for (const float alpha : {0.02f, 0.2f, 0.9f}) {
      EXPECT_EQ(sheen.albedo(mu, alpha), lobe_tables().sheen->albedo(mu, alpha));
      for (const float eta : {1.5f, 1 / 1.5f}) {
        EXPECT_EQ(three.albedo(mu, alpha, eta).sum(0.04f, 1), one.albedo(mu, alpha, eta).sum(0.04f, 1));
      }
    }
  }
}

TEST(LayeredFurnace, AGlassTableOfManyIndicesIsReadBetweenThem) {
  std::vector<float> indices;
  for (int i = 0; i < 40; ++i) indices.push_back(1.02f + 0.04f * static_cast<float>(i));
  const GlassTable many(indices);
  EXPECT_LT(many.resident_bytes(), 2u << 20);
  for (const float ior : {1.02f, 1.3f, 1.5f, 2.58f}) {
    for (const float eta : {ior, 1 / ior}) {
      for (const float alpha : {0.05f, 0.5f}) {
        const GlassAlbedo fine = integrate_glass_albedo(0.4f, alpha, eta, 20000);
        EXPECT_NEAR(many.albedo(0.4f, alpha, eta).sum(0.04f, 1), fine.sum(0.04f, 1), 0.01) << alpha << " " << eta;
      }
    }
  }
}

TEST(LayeredFurnace, AFilmReflectsBetweenNothingAndEverythingAndNothingOfItselfWhenItVanishes) {
  for (const float thickness : {0.0f, 50.0f, 120.0f, 350.0f, 800.0f, 5000.0f, 1e6f}) {
    for (const float ior : {1.0f, 1.3f, 1.8f, 50.0f}) {
      for (const float f0 : {0.0f, 0.04f, 0.5f, 1.0f}) {
        for (const float mu : {0.01f, 0.3f, 1.0f}) {
          const Vec3 r = thin_film_reflectance(mu, ior, thickness, Vec3(f0));
          for (int c = 0; c < 3; ++c) EXPECT_TRUE(r[c] >= 0 && r[c] <= 1) << thickness << " " << ior << " " << f0;
        }
      }
    }
  }
  EXPECT_NEAR(thin_film_reflectance(1, 1.5f, 0, Vec3(0.04f)).y, 0.04f, 0.01f);
  const Vec3 blue = thin_film_reflectance(1, 1.3f, 200, Vec3(0.3f)),
             red = thin_film_reflectance(1, 1.3f, 300, Vec3(0.3f));
  EXPECT_GT(glm::length(blue - red), 0.05f);
}

}  // namespace
}  // namespace shoal
