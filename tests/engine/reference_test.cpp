// Pictures of real scenes against an independent path tracer's.
#include "tests/engine/reference_picture.h"

namespace shoal {
namespace {

#ifndef SHOAL_REFERENCE_SAMPLES
#define SHOAL_REFERENCE_SAMPLES 256
#endif

using namespace testing;

TEST_F(ReferencePicture, CoffeeLambertAgrees) {
  expect_agreement(render_and_compare("coffee", "coffee-lambert", 0, SHOAL_REFERENCE_SAMPLES), 0.01, 0.04);
}
// The reference of this scene is 1.1 % too dark, and up to 12 % where its large ceiling panels are seen at grazing angles:
// docs/decisions/0010-lamp-reference.md shows it by the exact irradiance of the panels, and by the same path tracer
// agreeing with ours within 0.02 % once the panels are cut into small triangles. Hence the wider tolerances here, and
// the exact test below.
TEST_F(ReferencePicture, LampLambertAgreesButForTheReferencesBias) {
  expect_agreement(render_and_compare("lamp", "lamp-lambert", 0, SHOAL_REFERENCE_SAMPLES), 0.015, 0.08);
}
TEST_F(ReferencePicture, LampLambertMeetsTheExactIrradianceOfItsPanels) {
  const std::vector<float> rgba = render_scene("lamp", "lamp-lambert", 0, 64, 1);
  double sum = 0;
  for (uint32_t y = 16; y <= 24; ++y) {
    for (uint32_t x = 16; x <= 24; ++x) sum += rgba[(y * kSide + x) * 4];
  }
  // Lambert's polygon formula for the panels at the wall point of pixel (20, 20): albedo 1, radiance 2. The mean of the
  // block is 0.6 % more (8192 samples a pixel), and its noise at these samples 0.3 %; Cycles was 28 % off.
  EXPECT_NEAR(sum / 81, 0.00098969, 0.000015);
}
TEST_F(ReferencePicture, KitchenLambertAgrees) {
  expect_agreement(render_and_compare("kitchen", "kitchen-lambert", 0, SHOAL_REFERENCE_SAMPLES), 0.01, 0.04);
}
TEST_F(ReferencePicture, HelmetLambertAgrees) {
  expect_agreement(render_and_compare("helmet", "helmet-lambert", 1, SHOAL_REFERENCE_SAMPLES), 0.01, 0.04);
}
// With the whole of glTF's materials, the tolerances are those of the reference's README: 8 % and 25 %. Its own formulas
// differ (docs/decisions/0026-what-the-reference-adds.md); principled_reference_test.cpp renders with them.
TEST_F(ReferencePicture, HelmetAgrees) { expect_agreement(render_and_compare("helmet", "helmet", 1, 64), 0.08, 0.25); }
TEST_F(ReferencePicture, MaterialTestballAgrees) {
  expect_agreement(render_and_compare("material-testball", "material-testball", 1, 64), 0.08, 0.25);
}
TEST_F(ReferencePicture, MaterialTestballLambertAgrees) {
  expect_agreement(render_and_compare("material-testball", "material-testball-lambert", 1, SHOAL_REFERENCE_SAMPLES),
                   0.01, 0.04);
}

}  // namespace
}  // namespace shoal
