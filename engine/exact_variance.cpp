#include "engine/exact_variance.h"

#include <bit>
#include <cmath>

namespace shoal {
namespace {

using Wide = unsigned __int128;

constexpr int kFractionBits = 88;  ///< of SquareSum

/// 256 bits in units of 2^-128, the lowest word first.
struct Words {
  uint64_t word[4] = {0, 0, 0, 0};
};

/// sum^2. The largest sum is below 2^126 units of 2^-64.
Words square(const FixedPoint128& sum) {
  const Wide value = Wide{static_cast<uint64_t>(sum.high)} << 64 | sum.low;
  const Wide magnitude = sum.high < 0 ? ~value + 1 : value;
  const uint64_t low = static_cast<uint64_t>(magnitude), high = static_cast<uint64_t>(magnitude >> 64);
  const Wide ll = Wide{low} * low, lh = Wide{low} * high, hh = Wide{high} * high;
  Words result;
  result.word[0] = static_cast<uint64_t>(ll);
  Wide carry = (ll >> 64) + static_cast<uint64_t>(lh) + static_cast<uint64_t>(lh);
  result.word[1] = static_cast<uint64_t>(carry);
  carry = (carry >> 64) + (lh >> 64) + (lh >> 64) + static_cast<uint64_t>(hh);
  result.word[2] = static_cast<uint64_t>(carry);
  result.word[3] = static_cast<uint64_t>((carry >> 64) + (hh >> 64));
  return result;
}

/// count * squares.
Words times(const SquareSum& squares, uint32_t count) {
  uint64_t product[4];
  Wide carry = 0;
  for (int i = 0; i < 3; ++i) {
    carry += Wide{squares.word[i]} * count;
    product[i] = static_cast<uint64_t>(carry);
    carry >>= 64;
  }
  product[3] = static_cast<uint64_t>(carry);
  constexpr int kUp = 128 - kFractionBits;  // below 2^212 units, so nothing is lost
  Words result;
  for (int i = 0; i < 4; ++i) {
    result.word[i] = product[i] << kUp | (i > 0 ? product[i - 1] >> (64 - kUp) : 0);
  }
  return result;
}

/// a - b, or 0 where cut-off bits make that negative.
double difference(const Words& a, const Words& b) {
  Words result;
  uint64_t borrow = 0;
  for (int i = 0; i < 4; ++i) {
    const Wide left = Wide{a.word[i]}, right = Wide{b.word[i]} + borrow;
    result.word[i] = static_cast<uint64_t>(left - right);
    borrow = left < right ? 1 : 0;
  }
  if (borrow != 0) return 0;
  double value = 0;
  for (int i = 3; i >= 0; --i) value += std::ldexp(static_cast<double>(result.word[i]), 64 * i - 128);
  return value;
}

}  // namespace

void SquareSum::add_square(float value) {
  const uint32_t bits = std::bit_cast<uint32_t>(value);
  const int exponent = static_cast<int>((bits >> 23) & 0xff);
  const uint64_t mantissa = (bits & 0x7fffffu) | 0x800000u;  // |value| = mantissa * 2^(exponent - 150)
  const int shift = 2 * (exponent - 150) + kFractionBits;
  if (exponent == 0 || shift <= -48) return;
  const uint64_t squared = mantissa * mantissa;
  const Wide term = shift >= 0 ? Wide{squared} << (shift % 64) : Wide{squared} >> -shift;
  const int first = shift >= 0 ? shift / 64 : 0;
  Wide carry = 0;
  for (int i = first; i < 3; ++i) {
    carry += word[i];
    if (i == first) carry += static_cast<uint64_t>(term);
    if (i == first + 1) carry += static_cast<uint64_t>(term >> 64);
    word[i] = static_cast<uint64_t>(carry);
    carry >>= 64;
  }
}

double sample_variance(const FixedPoint128& sum, const SquareSum& squares, uint32_t count) {
  if (count < 2) return 0;
  return difference(times(squares, count), square(sum)) / (static_cast<double>(count) * (count - 1.0));
}

}  // namespace shoal
