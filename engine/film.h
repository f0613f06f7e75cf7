// The film: where the radiance of finished paths is remembered. Sums are kept in 128-bit fixed point (64 bits of
// fraction), so that adding is exact and any order gives the same bits, for 1e-10 beside 1e10.
// Where samples are drawn by what was seen (engine/adaptive_sampling.h), a pixel has two halves, each with its own sums,
// and its value is the mean of the two halves' means, however many samples each has.
// Called by engine/render_*. Threads: any number; a striped lock guards a pixel. Cost: 56 bytes a pixel and half.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
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
    const uint64_t carry = sum < low ? 1 : 0;
    high = static_cast<int64_t>(static_cast<uint64_t>(high) + static_cast<uint64_t>(other.high) + carry);
    low = sum;
  }
  /// Exact for |value| in [2^-64 * 2^23, 2^62); smaller bits are cut off towards zero. Requires: finite, |value| < 2^62.
  static FixedPoint128 from_float(float value);
  /// Whether it is in the range of sums: what is read from a file may be anything.
  bool in_range() const { return high >= -(int64_t{1} << 62) && high < (int64_t{1} << 62); }
  double to_double() const;
};

class Film {
 public:
  /// `halves`: 1 or 2.
  Film(uint32_t width, uint32_t height, uint32_t halves = 1);
  static uint64_t bytes(uint32_t width, uint32_t height, uint32_t halves) {
    return uint64_t{width} * height * halves * sizeof(Pixel);
  }

  /// Adds one sample's radiance. Returns false when a channel was clamped to kMaxRadiance (counted by the caller).
  /// Requires: finite values.
  bool add(uint32_t pixel, const Vec3& radiance, bool covered, uint32_t half = 0);

  /// Mean of the samples that were added to a pixel by now, and how many those are (with none: black); of a half without
  /// samples nothing is known. May be asked while others add.
  uint32_t mean(uint32_t pixel, float rgb[3]) const;

  /// Means of the samples that each pixel has: width * height * 4 floats, RGBA, rows from the top; A is the covered
  /// fraction. Without samples: 0.
  std::vector<float> resolve() const;

  /// Of a pixel, while nobody adds, both halves together: the sum of a channel, its samples, and those whose camera ray
  /// hit something.
  FixedPoint128 sum(size_t pixel, int channel) const {
    FixedPoint128 sum = pixels_[pixel].rgb[channel];
    if (halves_ == 2) sum.add(pixels_[second(pixel)].rgb[channel]);
    return sum;
  }
  uint32_t added(size_t pixel) const { return added(pixel, 0) + (halves_ == 2 ? added(pixel, 1) : 0); }
  uint32_t covered(size_t pixel) const {
    return pixels_[pixel].covered + (halves_ == 2 ? pixels_[second(pixel)].covered : 0);
  }
  /// Of one half.
  uint32_t added(size_t pixel, uint32_t half) const { return pixels_[half == 0 ? pixel : second(pixel)].added; }

  /// The sums as they are stored (docs/file_format.md), while nobody adds.
  std::span<std::byte> raw() { return std::as_writable_bytes(std::span(pixels_)); }
  /// Whether every pixel holds what so many samples can bring, whatever raw() was filled with.
  bool plausible(uint32_t samples) const;
  /// Adds the sums of pixels of another film from `first_byte` of its raw() on. Requires: the same halves; whole pixels.
  void add_raw(uint64_t first_byte, std::span<const std::byte> bytes);

  uint32_t width() const { return width_; }
  uint32_t height() const { return height_; }

  static constexpr float kMaxRadiance = 0x1p40f;  ///< 2^22 samples of it fit the sum
  static constexpr uint64_t kPixelBytes = 56;     ///< of a half, in raw()

 private:
  struct Pixel {
    FixedPoint128 rgb[3];
    uint32_t covered = 0;
    uint32_t added = 0;  ///< samples
  };
  static_assert(sizeof(FixedPoint128) == 16);
  static constexpr uint32_t kLocks = 4096;
  size_t second(size_t pixel) const { return size_t{width_} * height_ + pixel; }
  /// Red, green, blue and the covered share; 0 without samples.
  struct Mean {
    double rgba[4];
  };
  static Mean mean_of(const Pixel& pixel);
  static Mean mean_of(const Pixel& a, const Pixel& b);

  uint32_t width_, height_, halves_;
  std::vector<Pixel> pixels_;  ///< the second halves after the first
  std::unique_ptr<SpinLock[]> locks_;
};

}  // namespace shoal
