// The variance of samples from exact sums of them and of their squares: whole numbers throughout, so that nothing
// cancels and the order of adding does not show. Called by engine/aov_film. Pure.
#pragma once

#include <cstdint>

#include "engine/film.h"

namespace shoal {

/// A sum of squares of floats in [0, 2^104), in units of 2^-88; of a square, what is below that is cut off. So squares
/// of values from 2^-20 (1e-6) up are exact, and values below 2^-44 count as 0.
struct SquareSum {
  uint64_t word[3] = {0, 0, 0};  ///< the lowest first

  /// Requires: finite, |value| <= Film::kMaxRadiance; at most 2^22 times.
  void add_square(float value);
  void add(const SquareSum& other) {
    unsigned __int128 sum = 0;
    for (int i = 0; i < 3; ++i) {
      sum += static_cast<unsigned __int128>(word[i]) + other.word[i];
      word[i] = static_cast<uint64_t>(sum);
      sum >>= 64;
    }
  }
};

/// Unbiased: the sum of squared distances from the mean over count - 1; 0 of fewer than two samples.
/// Requires: count <= 2^22.
double sample_variance(const FixedPoint128& sum, const SquareSum& squares, uint32_t count);

}  // namespace shoal
