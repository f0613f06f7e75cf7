// Whole paths through volumes, against closed formulas: Beer's law, straight volumes that are not there,
// wavelengths.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/dispersion.h"
#include "engine/math.h"
#include "tests/support/shading_scene.h"

namespace shoal {
namespace {

using namespace testing;

ShadingOptions sky(float radiance, uint32_t bounces = 64) {
  ShadingOptions options;
  options.bounces = bounces;
  options.roulette_start = 1000;
  options.environment.kind = EnvironmentOptions::Kind::kConstant;
  options.environment.radiance = Vec3(radiance);
  return options;
}

/// A box of 2 x 2 x 2 around the origin, front faces outwards.
ShadingScene box_scene(uint32_t effects, float f0) {
  TriangleSoup soup;
  const Vec3 x(2, 0, 0), y(0, 2, 0), z(0, 0, 2), c(-1, -1, -1);
  add_rectangle(soup, c, y, x, 0), add_rectangle(soup, c + z, x, y, 0);
  add_rectangle(soup, c, z, y, 0), add_rectangle(soup, c + x, y, z, 0);
  add_rectangle(soup, c, x, z, 0), add_rectangle(soup, c + y, z, x, 0);
  Material m = matte(Vec3(1));
  m.roughness = 0, m.specular = f0 > 0 ? 1.0f : 0.0f, m.dielectric_f0 = f0;
  m.effects = effects, m.layers = 0;
  return ShadingScene(std::move(soup), {m});
}

MaterialLayers clear(float ior) {
  MaterialLayers l;
  l.transmission = 1, l.volume = 1, l.ior = ior;
  return l;
}

constexpr uint32_t kGlassEffects = kEffectTransmission | kEffectVolume;

TEST(VolumeTransport, AVolumeThatBendsNothingAbsorbsByBeersLaw) {
  MaterialLayers l = clear(1);
  l.absorption[0] = -0.5f, l.absorption[1] = -1, l.absorption[2] = 0;
  ShadingScene s = box_scene(kGlassEffects, 0);
  s.scene.material_layers = {l};
  s.prepare(sky(1));
  const Vec3 through =
      s.mean_radiance({0.1f, 0.2f, 5}, {0, 0, -3}, 2000);  // 2 units, whatever the direction's length
  EXPECT_NEAR(through.x, std::exp2(-1.0), 0.01);
  EXPECT_NEAR(through.y, std::exp2(-2.0), 0.01);
  EXPECT_NEAR(through.z, 1, 0.01);
  const Vec3 inside = s.mean_radiance({0, 0, 0}, {0, 0, -1}, 2000);  // a camera in the volume
  EXPECT_NEAR(inside.x, std::exp2(-0.5), 0.01);
  EXPECT_NEAR(s.mean_radiance({3, 3, 5}, {0, 0, -1}, 10).x, 1, 1e-6);
}

TEST(VolumeTransport, ClearGlassUnderAnEvenSkyCannotBeSeen) {
  for (const float ior : {1.33f, 1.5f, 2.4f}) {
    const float r = (ior - 1) / (ior + 1);
    ShadingScene s = box_scene(kGlassEffects, r * r);
    s.scene.material_layers = {clear(ior)};
    s.prepare(sky(1, 200));
    EXPECT_NEAR(s.mean_radiance({0.3f, 0.2f, 5}, {-0.05f, 0.02f, -1}, 4000).y, 1, 0.02) << ior;
  }
}

TEST(VolumeTransport, DispersionLeavesWhiteWhite) {
  MaterialLayers l = clear(1.5f);
  l.dispersion = 3;
  ShadingScene s = box_scene(kGlassEffects | kEffectDispersion, 0.04f);
  s.scene.material_layers = {l};
  s.prepare(sky(1, 200));
  const Vec3 mean = s.mean_radiance({0.3f, 0.2f, 5}, {-0.05f, 0.02f, -1}, 20000);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(mean[c], 1, 0.04) << c;
}

TEST(VolumeTransport, IndicesFollowTheAbbeNumber) {
  // The extension: V = (n_d - 1) / (n_F - n_C), at 486.1, 587.6 and 656.3 nm.
  for (const float dispersion : {0.33f, 1.0f}) {
    const float spread = dispersed_ior(1.5f, dispersion, 486.1f) - dispersed_ior(1.5f, dispersion, 656.3f);
    EXPECT_NEAR(0.5f / spread, 20 / dispersion, 0.01f * 20 / dispersion);
    EXPECT_NEAR(dispersed_ior(1.5f, dispersion, 587.6f), 1.5f, 1e-4f);
  }
  EXPECT_EQ(dispersed_ior(1.01f, 100, 700), 1);
  glm::dvec3 sum(0);
  for (int i = 0; i < 3000; ++i)
    sum += glm::dvec3(wavelength_weight(kShortestWave + 0.1f * (static_cast<float>(i) + 0.5f))) / 3000.0;
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum[c], 1, 1e-4);
}

TEST(VolumeTransport, UnlitSurfacesShowTheirColourAndScatterNothing) {
  TriangleSoup soup;
  add_rectangle(soup, {-5, -5, 0}, {10, 0, 0}, {0, 10, 0}, 0);
  Material m = matte(Vec3(0.2f, 0.5f, 0.9f));
  m.effects = kEffectUnlit;
  ShadingScene s(std::move(soup), {m});
  s.prepare(sky(7));
  EXPECT_EQ(s.radiance({0, 0, 3}, {0, 0, -1}, 0, 0), Vec3(0.2f, 0.5f, 0.9f));
  EXPECT_EQ(s.radiance({0, 0, -3}, {0, 0, 1}, 0, 1), Vec3(0.2f, 0.5f, 0.9f));
  EXPECT_EQ(s.shadow_rays, 0);
}

TEST(VolumeTransport, APaneLetsTheColourOfItsSurfaceThrough) {
  TriangleSoup soup;
  add_rectangle(soup, {-5, -5, 0}, {10, 0, 0}, {0, 10, 0}, 0);
  Material m = matte(Vec3(0.2f, 0.5f, 1));
  m.roughness = 0, m.effects = kEffectTransmission, m.layers = 0;
  ShadingScene s(std::move(soup), {m});
  MaterialLayers l;
  l.transmission = 1;
  s.scene.material_layers = {l};
  s.prepare(sky(1));
  const Vec3 through = s.mean_radiance({0, 0, 3}, {0, 0, -1}, 2000);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(through[c], m.base_color[c], 0.01f) << c;
}

}  // namespace
}  // namespace shoal
