// Points of Sobol's sequence (Sobol 1967), scrambled and shuffled by hashing: Burley 2020, "Practical Hash-based Owen
// Scrambling", JCGT 9(4), with the hash of Vegdahl 2021, "Building a Better LK Hash", instead of that of its section 3
// (Laine & Karras 2011), whose low bits hardly mix.
//
// All numbers here are **reversed**: bit 0 is the first digit after the point. Then a scrambling in which every digit
// depends on the digits before it alone (Owen 1995) is a hash in which every bit depends on lower bits alone: sums and
// products, no rotations. Called by engine/sampler and tests. Pure.
//
// Dimensions 0 and 1 together: any 2^m points that begin at a multiple of 2^m are a (0, m, 2)-net (every box of area
// 2^-m whose sides are powers of two holds one). Dimension 2 alone is as even; with one of the others its nets have
// t = 1 at most (Joe & Kuo 2008: polynomials 1, x + 1, x^2 + x + 1).
#pragma once

#include <array>
#include <cstdint>

namespace shoal {

inline constexpr uint32_t reversed_bits(uint32_t x) {
  x = (x >> 16) | (x << 16);
  x = ((x & 0xff00ff00u) >> 8) | ((x & 0x00ff00ffu) << 8);
  x = ((x & 0xf0f0f0f0u) >> 4) | ((x & 0x0f0f0f0fu) << 4);
  x = ((x & 0xccccccccu) >> 2) | ((x & 0x33333333u) << 2);
  return ((x & 0xaaaaaaaau) >> 1) | ((x & 0x55555555u) << 1);
}

/// Owen's scrambling of a reversed number.
inline constexpr uint32_t owen_scrambled(uint32_t reversed, uint32_t key) {
  uint32_t x = reversed;
  x ^= x * 0x3d20adeau;
  x += key;
  x *= (key >> 16) | 1;
  x ^= x * 0x05526c56u;
  return x ^ x * 0x53a22864u;
}

/// A permutation of all indices that maps every run of 2^m, at a multiple of 2^m, to such a run (Burley 2020, section
/// 4: "nested uniform shuffle").
inline constexpr uint32_t shuffled_index(uint32_t index, uint32_t key) {
  return reversed_bits(owen_scrambled(reversed_bits(index), key));
}

/// Dimension 0 is the index itself, reversed: van der Corput's sequence.
inline constexpr uint32_t sobol0_reversed(uint32_t index) { return index; }

/// Pascal's triangle modulo 2 times the index, a power of two of rows at a time.
inline constexpr uint32_t sobol1_reversed(uint32_t index) {
  uint32_t x = index;
  x ^= x >> 1 & 0x55555555u;
  x ^= x >> 2 & 0x33333333u;
  x ^= x >> 4 & 0x0f0f0f0fu;
  x ^= x >> 8 & 0x00ff00ffu;
  return x ^ x >> 16;
}

/// [i][digit]: what the i-th hexadecimal digit of the index adds to dimension 2. Of the recurrence for x^2 + x + 1 from
/// m = 1, 3 (Joe & Kuo 2008, eq. 2).
using SobolDigits = std::array<std::array<uint32_t, 16>, 8>;
inline constexpr SobolDigits kSobol2 = [] {
  std::array<uint32_t, 32> column{};
  uint64_t m[32] = {1, 3};
  for (uint32_t i = 0; i < 32; ++i) {
    if (i >= 2) m[i] = 2 * m[i - 1] ^ 4 * m[i - 2] ^ m[i - 2];
    column[i] = reversed_bits(static_cast<uint32_t>(m[i] << (31 - i)));
  }
  SobolDigits table{};
  for (uint32_t i = 0; i < 32; ++i) {
    for (uint32_t digit = 0; digit < 16; ++digit) {
      if ((digit >> i % 4 & 1) != 0) table[i / 4][digit] ^= column[i];
    }
  }
  return table;
}();

inline constexpr uint32_t sobol2_reversed(uint32_t index) {
  uint32_t x = 0;
  for (uint32_t i = 0; i < 8; ++i) x ^= kSobol2[i][index >> 4 * i & 15];
  return x;
}

}  // namespace shoal
