#include "engine/math.h"

#include <bit>
#include <cmath>
#include <cstdint>

namespace shoal {
namespace {

constexpr double kPiDouble = 3.14159265358979323846;
constexpr double kHalfPi = 1.57079632679489661923;

/// Taylor polynomials for |r| <= pi/4: the first term left out is below 7e-12 (sin) and 1.2e-10 (cos).
double sin_reduced(double r) {
  const double z = r * r;
  return r *
         (1 + z * (-1.0 / 6 + z * (1.0 / 120 + z * (-1.0 / 5040 + z * (1.0 / 362880 + z * (-1.0 / 39916800))))));
}
double cos_reduced(double r) {
  const double z = r * r;
  return 1 + z * (-1.0 / 2 + z * (1.0 / 24 + z * (-1.0 / 720 + z * (1.0 / 40320 + z * (-1.0 / 3628800)))));
}

/// atan on [0, 1]: above tan(pi/8) atan z = pi/4 + atan((z - 1) / (z + 1)); then the series, whose first term left
/// out is below tan(pi/8)^19 / 19 = 3e-9.
double arc_tangent_unit(double z) {
  constexpr double kTanEighthPi = 0.41421356237309504880;
  double base = 0;
  if (z > kTanEighthPi) base = kPiDouble / 4, z = (z - 1) / (z + 1);
  const double q = z * z;
  double sum = 1.0 / 17;
  sum = 1.0 / 15 - q * sum;
  sum = 1.0 / 13 - q * sum;
  sum = 1.0 / 11 - q * sum;
  sum = 1.0 / 9 - q * sum;
  sum = 1.0 / 7 - q * sum;
  sum = 1.0 / 5 - q * sum;
  sum = 1.0 / 3 - q * sum;
  return base + z * (1 - q * sum);
}

double arc_tangent_double(double y, double x) {
  const double ax = std::fabs(x), ay = std::fabs(y);
  if (ax == 0 && ay == 0) return 0;
  double angle = ax >= ay ? arc_tangent_unit(ay / ax) : kHalfPi - arc_tangent_unit(ax / ay);
  if (x < 0) angle = kPiDouble - angle;
  return y < 0 ? -angle : angle;
}

/// log2 of a positive normal number: exponent plus 2 atanh(s) / ln 2, s = (m - 1) / (m + 1), m in [sqrt 1/2, sqrt
/// 2).
double log2_positive(double x) {
  const uint64_t bits = std::bit_cast<uint64_t>(x);
  int exponent = static_cast<int>(bits >> 52) - 1023;
  double m = std::bit_cast<double>((bits & 0x000fffffffffffffull) | 0x3ff0000000000000ull);
  if (m > 1.41421356237309504880) m *= 0.5, ++exponent;
  const double s = (m - 1) / (m + 1), q = s * s;
  double sum = 1.0 / 15;
  for (int k = 13; k >= 1; k -= 2) sum = 1.0 / k + q * sum;
  return exponent + 2 * s * sum * 1.44269504088896340736;
}

/// 2^x for |x| < 1000: exponent bits times the series of exp on |x ln 2| <= ln(2) / 2.
double exp2_bounded(double x) {
  const double whole = std::floor(x + 0.5);
  const double r = (x - whole) * 0.69314718055994530942;
  double sum = 1;
  for (int k = 12; k >= 1; --k) sum = 1 + r * sum / k;
  return sum * std::bit_cast<double>(static_cast<uint64_t>(static_cast<int64_t>(whole) + 1023) << 52);
}

}  // namespace

SinCos sin_cos(float x) {
  if (!(std::fabs(x) <= 0x1p20f)) return {0, 1};
  // pi/2 in two parts; the upper one has 33 bits, so that its product with a 20-bit integer is exact (Cody &
  // Waite).
  constexpr double kHalfPiHigh = 0x1.921fb544p+0, kHalfPiLow = 0x1.0b4611a626331p-34;
  const double k = std::floor(static_cast<double>(x) * (2 / kPiDouble) + 0.5);
  const double r = (static_cast<double>(x) - k * kHalfPiHigh) - k * kHalfPiLow;
  const double s = sin_reduced(r), c = cos_reduced(r);
  switch (static_cast<int>(k) & 3) {
    case 0:
      return {static_cast<float>(s), static_cast<float>(c)};
    case 1:
      return {static_cast<float>(c), static_cast<float>(-s)};
    case 2:
      return {static_cast<float>(-s), static_cast<float>(-c)};
    default:
      return {static_cast<float>(-c), static_cast<float>(s)};
  }
}

float arc_tangent(float y, float x) { return static_cast<float>(arc_tangent_double(y, x)); }

float arc_cosine(float x) {
  const double c = x < -1 ? -1.0 : x > 1 ? 1.0 : static_cast<double>(x);
  return static_cast<float>(arc_tangent_double(std::sqrt((1 - c) * (1 + c)), c));
}

float srgb_to_linear(float encoded) {
  if (!(encoded > 0.04045f)) return static_cast<float>(encoded / 12.92);
  return static_cast<float>(exp2_bounded(2.4 * log2_positive((encoded + 0.055) / 1.055)));
}

float linear_to_srgb(float linear) {
  if (!(linear > 0.0031308f)) return static_cast<float>(linear * 12.92);
  return static_cast<float>(1.055 * exp2_bounded(log2_positive(linear) / 2.4) - 0.055);
}

float log2_of(float x) { return static_cast<float>(log2_positive(x)); }

float exp2_of(float x) {
  if (!(x >= -126)) return 0;
  return static_cast<float>(exp2_bounded(std::fmin(x, 127.0f)));
}

float power_of(float x, float y) {
  if (!(x > 0)) return 0;
  const double exponent = static_cast<double>(y) * log2_positive(x);
  if (!(exponent >= -126)) return 0;
  return static_cast<float>(exp2_bounded(std::fmin(exponent, 127.0)));
}

}  // namespace shoal
