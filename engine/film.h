// The film: where the radiance of finished paths is remembered. Sums are kept in 128-bit fixed point (64 bits of
// fraction), so that adding is exact and any order gives the same bits, for 1e-10 beside 1e10.
// Called by engine/render_*. Threads: any number; a striped lock guards a pixel. Cost: 56 bytes a pixel.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "queues/spin_lock.h"
#include "treelets/vector.h"

namespace shoal {

/// Signed 64.64 fixed point.
struct FixedPoint128 {
  int64_t high = 0;
  uint64_t low = 0;

  void add(const FixedPoint128& other) {
    const uint64_t sum = low + other.low;
    high += other.high + (sum < low ? 1 : 0);
    low = sum;
  }
  /// Exact for |value| in [2^-64 * 2^23, 2^62); smaller bits are cut off towards zero. Requires: finite, |value| < 2^62.
  static FixedPoint128 from_float(float value);
  double to_double() const;
};

class Film {
 public:
  Film(uint32_t width, uint32_t height);
  static uint64_t bytes(uint32_t width, uint32_t height) { return uint64_t{width} * height * sizeof(Pixel); }

  /// Adds one sample's radiance. Returns false when a channel was clamped to kMaxRadiance (counted by the caller).
  /// Requires: finite values.
  bool add(uint32_t pixel, const Vec3& radiance, bool covered);

  /// Mean of the samples that were added to a pixel by now, and how many those are (with none: black). May be asked
  /// while others add.
  uint32_t mean(uint32_t pixel, float rgb[3]) const;

  /// Means of the samples that each pixel has: width * height * 4 floats, RGBA, rows from the top; A is the covered
  /// fraction. Without samples: 0.
  std::vector<float> resolve() const;

  /// Of a pixel, while nobody adds: the sum of a channel, its samples, and those whose camera ray hit something.
  const FixedPoint128& sum(size_t pixel, int channel) const { return pixels_[pixel].rgb[channel]; }
  uint32_t added(size_t pixel) const { return pixels_[pixel].added; }
  uint32_t covered(size_t pixel) const { return pixels_[pixel].covered; }

  uint32_t width() const { return width_; }
  uint32_t height() const { return height_; }

  static constexpr float kMaxRadiance = 0x1p40f;  ///< 2^22 samples of it fit the sum

 private:
  struct Pixel {
    FixedPoint128 rgb[3];
    uint32_t covered = 0;
    uint32_t added = 0;  ///< samples
  };
  static constexpr uint32_t kLocks = 4096;
  uint32_t width_, height_;
  std::vector<Pixel> pixels_;
  std::unique_ptr<SpinLock[]> locks_;
};

}  // namespace shoal
