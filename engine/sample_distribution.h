// Piecewise-constant distributions in one and two dimensions by inversion of the cumulative sum, in double, so that
// the density reported is the one sampled even with millions of entries. Called by engine/light_sampler and
// engine/environment. Immutable after construction; sampling is a binary search.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "treelets/vector.h"

namespace shoal {

/// Chooses an index with probability proportional to its weight.
class Distribution1D {
 public:
  Distribution1D() = default;
  /// Weights that are negative or not finite count as zero. When all are zero so is total(), and nothing may be
  /// drawn.
  explicit Distribution1D(std::span<const double> weights);

  double total() const { return total_; }  ///< sum of the weights
  size_t size() const { return cumulative_.size(); }
  double probability(size_t index) const {
    return cumulative_[index] - (index == 0 ? 0.0 : cumulative_[index - 1]);
  }
  /// Requires: total() > 0, u in [0, 1). `*remainder` (may be null) is where u falls inside the choice, in [0, 1).
  size_t sample(double u, double* remainder) const;
  uint64_t resident_bytes() const { return cumulative_.size() * sizeof(double); }

 private:
  std::vector<double> cumulative_;  ///< normalised, inclusive; the last with a weight and all after it are 1
  double total_ = 0;
};

/// A density on the unit square: a row by its sum, then a column in it. Row 0 is at v = 0.
class Distribution2D {
 public:
  Distribution2D() = default;
  /// `weights` row by row, width * height of them.
  Distribution2D(std::span<const double> weights, uint32_t width, uint32_t height);
  /// `row(y, weights)` sets the weights of a row: they are never all in memory beside what is kept.
  Distribution2D(uint32_t width, uint32_t height, const std::function<void(uint32_t, std::span<double>)>& row);

  double total() const { return rows_.total(); }
  /// Requires: total() > 0.
  Vec2 sample(double u1, double u2, double* pdf) const;
  /// With respect to area on the unit square.
  double pdf(const Vec2& uv) const;
  uint64_t resident_bytes() const;

 private:
  uint32_t width_ = 0, height_ = 0;
  Distribution1D rows_;
  std::vector<Distribution1D> columns_;
};

}  // namespace shoal
