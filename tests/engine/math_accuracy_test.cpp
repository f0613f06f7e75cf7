// Our transcendental functions against double libm, over dense sweeps.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "engine/math.h"

namespace shoal {
namespace {

TEST(Math, SineAndCosineStayWithinTheirBoundOverAllAngles) {
  double worst = 0;
  for (int i = -200000; i <= 200000; ++i) {
    const float x = static_cast<float>(i) * 0.16384f * 0.99971f;
    const SinCos value = sin_cos(x);
    worst = std::max(worst, std::abs(value.sin - std::sin(static_cast<double>(x))));
    worst = std::max(worst, std::abs(value.cos - std::cos(static_cast<double>(x))));
  }
  EXPECT_LT(worst, 0x1p-23);
}

TEST(Math, SineAndCosineAreFiniteForAnyArgument) {
  for (const float x :
       {1e30f, -1e30f, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
    EXPECT_EQ(sin_cos(x).sin, 0);
    EXPECT_EQ(sin_cos(x).cos, 1);
  }
}

TEST(Math, ArcTangentStaysWithinItsBoundInEveryQuadrant) {
  double worst = 0;
  for (int i = 0; i < 100000; ++i) {
    const double angle = (i - 50000) * (3.14159265 / 50000);
    const float radius = std::ldexp(1.0f, i % 60 - 30);
    const float y = static_cast<float>(std::sin(angle)) * radius, x = static_cast<float>(std::cos(angle)) * radius;
    worst =
        std::max(worst, std::abs(arc_tangent(y, x) - std::atan2(static_cast<double>(y), static_cast<double>(x))));
  }
  EXPECT_LT(worst, 0x1p-21);
  EXPECT_EQ(arc_tangent(0, 0), 0);
  EXPECT_FLOAT_EQ(arc_tangent(0, -1), kPi);
  EXPECT_FLOAT_EQ(arc_tangent(1, 0), kPi / 2);
}

TEST(Math, ArcCosineStaysWithinItsBoundAndClampsItsArgument) {
  double worst = 0;
  for (int i = -100000; i <= 100000; ++i) {
    const float x = static_cast<float>(i) / 100000.0f;
    worst = std::max(worst, std::abs(arc_cosine(x) - std::acos(static_cast<double>(x))));
  }
  EXPECT_LT(worst, 0x1p-21);
  EXPECT_EQ(arc_cosine(1.5f), 0);
  EXPECT_FLOAT_EQ(arc_cosine(-1.5f), kPi);
}

double linear_from_srgb(double s) { return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4); }
double srgb_from_linear(double x) { return x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055; }

TEST(Math, SrgbTransferFunctionsFollowTheStandard) {
  double worst = 0;
  for (int i = 1; i <= 400000; ++i) {
    const float x = static_cast<float>(i) * 0.00001f;
    worst = std::max(worst, std::abs(srgb_to_linear(x) / linear_from_srgb(x) - 1));
    worst = std::max(worst, std::abs(linear_to_srgb(x) / srgb_from_linear(x) - 1));
  }
  EXPECT_LT(worst, 0x1p-22);
  EXPECT_EQ(srgb_to_linear(0), 0);
  EXPECT_EQ(srgb_to_linear(1), 1);
}

}  // namespace
}  // namespace shoal
