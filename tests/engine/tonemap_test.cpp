#include "engine/tonemap.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace shoal {
namespace {

// The reference code of the Khronos PBR Neutral Tone Mapper specification, transcribed in double.
std::array<double, 3> reference_neutral(double r, double g, double b) {
  const double start = 0.8 - 0.04, desaturation = 0.15;
  const double x = std::min(r, std::min(g, b));
  const double offset = x < 0.08 ? x - 6.25 * x * x : 0.04;
  double c[3] = {r - offset, g - offset, b - offset};
  const double peak = std::max(c[0], std::max(c[1], c[2]));
  if (peak < start) return {c[0], c[1], c[2]};
  const double d = 1.0 - start;
  const double new_peak = 1.0 - d * d / (peak + d - start);
  for (double& v : c) v *= new_peak / peak;
  const double mix = 1.0 - 1.0 / (desaturation * (peak - new_peak) + 1.0);
  return {c[0] * (1 - mix) + new_peak * mix, c[1] * (1 - mix) + new_peak * mix, c[2] * (1 - mix) + new_peak * mix};
}

TEST(ToneMap, PbrNeutralFollowsTheSpecification) {
  for (float r : {0.0f, 0.01f, 0.079f, 0.2f, 0.75f, 0.81f, 1.0f, 4.0f, 900.0f}) {
    for (float g : {0.0f, 0.05f, 0.5f, 2.0f, 50.0f}) {
      for (float b : {0.0f, 0.08f, 0.9f, 12.0f}) {
        const Vec3 mapped = pbr_neutral({r, g, b});
        const auto expected = reference_neutral(r, g, b);
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(mapped[c], expected[c], 2e-6) << r << ' ' << g << ' ' << b;
      }
    }
  }
}

TEST(ToneMap, PbrNeutralLeavesBaseColorsAloneExceptForTheDielectricOffset) {
  const Vec3 mapped = pbr_neutral({0.5f, 0.3f, 0.2f});
  EXPECT_FLOAT_EQ(mapped.x, 0.46f);
  EXPECT_FLOAT_EQ(mapped.y, 0.26f);
  EXPECT_FLOAT_EQ(mapped.z, 0.16f);
}

TEST(ToneMap, ExposureScaleIsAPowerOfTwo) {
  for (float stops = -20; stops <= 20; stops += 0.37f) {
    EXPECT_NEAR(exposure_scale(stops) / std::exp2(static_cast<double>(stops)), 1.0, 1e-12) << stops;
  }
  EXPECT_EQ(exposure_scale(0), 1.0);
  EXPECT_EQ(exposure_scale(3), 8.0);
  EXPECT_EQ(exposure_scale(-2), 0.25);
  EXPECT_EQ(exposure_scale(std::numeric_limits<float>::quiet_NaN()), exposure_scale(-100));
}

TEST(ToneMap, NoneClipsAndValuesThatAreNoLightAreBlack) {
  const ToneMapOptions none{ToneCurve::kNone, 0};
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  const Vec3 mapped = tone_map({-1, nan, infinity}, none);
  EXPECT_EQ(mapped, Vec3(0, 0, 1));
  EXPECT_EQ(tone_map({0.25f, 0.5f, 3}, none), Vec3(0.25f, 0.5f, 1));
  EXPECT_EQ(tone_map({0.25f, 0.5f, 3}, {ToneCurve::kNone, -1}), Vec3(0.125f, 0.25f, 1));
  const Vec3 bright = tone_map({infinity, infinity, infinity}, {});
  for (int c = 0; c < 3; ++c) EXPECT_TRUE(bright[c] > 0.99f && bright[c] <= 1.0f) << bright[c];
}

TEST(ToneMap, ImageIsEncodedAsSrgb) {
  const float red[] = {0, 1, 0.2140411f}, green[] = {0, 1, 0.0033f}, blue[] = {0, 1, 0.5f};
  const auto bytes = tone_map_image(red, green, blue, {ToneCurve::kNone, 0});
  const std::vector<uint8_t> expected = {0, 0, 0, 255, 255, 255, 128, 11, 188};
  ASSERT_EQ(bytes.size(), expected.size());
  for (size_t i = 0; i < bytes.size(); ++i) EXPECT_NEAR(bytes[i], expected[i], i < 6 ? 0 : 1) << i;
}

TEST(ToneMap, CurvesAreFoundByName) {
  EXPECT_EQ(parse_tone_curve("pbr-neutral").value(), ToneCurve::kPbrNeutral);
  EXPECT_EQ(parse_tone_curve("none").value(), ToneCurve::kNone);
  EXPECT_EQ(parse_tone_curve("filmic").error().code, ErrorCode::kUsage);
}

}  // namespace
}  // namespace shoal
