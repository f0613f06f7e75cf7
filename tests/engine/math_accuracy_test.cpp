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

TEST(Math, LogarithmsExponentialsAndPowersStayWithinTheirBounds) {
  double worst_log = 0, worst_exp = 0, worst_power = 0;
  for (int i = 1; i < 100000; ++i) {
    const float x = std::ldexp(1.0f + static_cast<float>(i % 997) / 997, i % 200 - 100);
    const double l = std::log2(static_cast<double>(x));
    worst_log = std::max(worst_log, std::abs(log2_of(x) - l) / std::max(1.0, std::abs(l)));
    const float y = static_cast<float>(i - 50000) / 400;
    worst_exp = std::max(worst_exp, std::abs(exp2_of(y) / std::exp2(static_cast<double>(y)) - 1));
    const float base = static_cast<float>(i) / 100000;
    const double power = std::pow(static_cast<double>(base), 7.3);
    if (power > 1e-30) worst_power = std::max(worst_power, std::abs(power_of(base, 7.3f) / power - 1));
  }
  EXPECT_LT(worst_log, 0x1p-20);
  EXPECT_LT(worst_exp, 0x1p-22);
  EXPECT_LT(worst_power, 0x1p-18);
  EXPECT_EQ(exp2_of(-1e30f), 0);
  EXPECT_EQ(exp2_of(0), 1);
  EXPECT_EQ(exp2_of(1e30f), std::exp2(127.0f));
  EXPECT_EQ(power_of(0, 2), 0);
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
