// Sampling where the picture is noisy, until it is as good as was asked for (`--target-noise`). Called by engine/render
// between passes, by engine/render_worker for every path. Why it neither shifts the picture nor flatters itself:
// docs/adaptive_sampling.md.
//
// The samples of a pixel are two halves, those with even and those with odd numbers. Each half is an adaptive render by
// itself: after every pass it judges, from its own samples alone, which blocks of 8 x 8 pixels it would go on with. What
// a half has judged is done to the other: the other's further samples of the block count, or they do not. So how many
// samples of a half count never depends on their values, and the mean of the two halves' means is what every sample is
// expected to be. A block is drawn, in both halves, while either half wants to see more of it.
//
// Properties and assumptions
//   noise      of a pixel: the estimated standard error of its luminance, relative to its luminance or to a tenth of the
//              picture's median luminance where that is more. Pixels that are the same every time are not counted.
//   exact      sums of samples and of their squares are whole numbers (engine/exact_variance.h): what is judged depends on
//              no order, thread or cap.
//   threads    add() and counts() any number, in a pass; all else one, between passes.
//   memory     bytes().
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/exact_variance.h"
#include "engine/film.h"
#include "engine/noise_target.h"
#include "engine/sample_order.h"
#include "queues/spin_lock.h"

namespace shoal {

class AdaptiveSampling {
 public:
  /// Samples of each half before anything is judged: chosen. A variance of fewer says little.
  static constexpr uint32_t kPilot = 8;

  AdaptiveSampling(uint32_t width, uint32_t height, const NoiseTarget& target, unsigned threads);
  static uint64_t bytes(uint32_t width, uint32_t height);
  /// The half that sample `sample` of a pixel belongs to.
  static uint32_t half_of(uint32_t sample) { return sample & 1; }

  /// The radiance of a sample that was drawn. `covered`: its camera ray hit something.
  void add(uint32_t pixel, uint32_t sample, const Vec3& radiance, bool covered);
  /// Whether it is part of the picture.
  bool counts(uint32_t pixel, uint32_t sample) const { return (counted_[block_of(pixel)] >> half_of(sample) & 1) != 0; }

  /// All samples up to `samples` a pixel of the blocks drawn are added, and those that count are in the film: judges
  /// them. Pixels without samples after the first pass are left out. Requires: samples is even.
  void end_pass(const Film& film, uint32_t samples);
  /// What the next pass draws; empty: nothing, the target is met as far as can be told.
  const std::vector<uint32_t>& blocks() const { return drawn_; }
  /// ... which are all that are rendered.
  bool whole_picture() const { return drawn_.size() == rendered_count_; }
  uint64_t drawn_pixels() const;
  /// How many samples, of all pixels together, it will take still, when no pixel gets more than `most`.
  uint64_t expected_samples(uint32_t most) const;

  /// What checkpoints hold (docs/file_format.md): numbers, then parts(). Written in a pass while nobody adds.
  struct Numbers {
    uint64_t rendered_count = 0;
    uint32_t samples = 0, drawn_count = 0;
    float more_of_all[2] = {0, 0}, dark[2] = {-1, -1};
  };
  Numbers numbers() const;
  std::vector<std::span<std::byte>> parts();
  /// Of those with so many blocks drawn.
  static uint64_t parts_bytes(uint32_t width, uint32_t height, uint32_t drawn_count);
  /// Makes room for the parts that belong to `numbers`; false when there are none such.
  bool take(const Numbers& numbers);
  /// Whether what the parts were filled with can be gone on with in a pass that begins after so many samples.
  bool plausible(uint32_t samples) const;

  /// The estimated standard error of every pixel's luminance in the film, and what of the target was reached. Nothing
  /// when there are too few samples to tell. Requires: end_pass() was called after the last pass.
  std::optional<NoiseReached> finish(const Film& film, std::vector<float>& errors) const;

 private:
  static constexpr uint32_t kBlock = SampleOrder::kBlock;
  static constexpr uint32_t kLocks = 4096;
  struct Sums {
    FixedPoint128 sum;
    SquareSum squares;
  };
  struct Moments {
    double mean = 0, variance = 0;
  };
  /// Of blocks in which nothing was seen.
  static constexpr Moments kNothing{0, -1};
  struct Half {
    std::vector<Sums> sums;             ///< of luminance
    std::vector<uint8_t> seen;          ///< 1: some camera ray hit something
    std::vector<float> noise;           ///< when it was judged last
    std::vector<float> variance;        ///< of the samples that count
    std::vector<Moments> blocks;        ///< means of the pixels seen, when it was judged last
    std::vector<float> more;            ///< by block: how many times its samples it takes, as judged last
    std::vector<uint8_t> judging;       ///< by block: it would go on
    float more_of_all = 0;              ///< likewise, until the whole picture meets the target
    float dark = -1;                    ///< luminance to which the noise of darker pixels is relative; from the first pass
  };
  struct Block {
    uint32_t x0, y0, x1, y1;
  };

  uint32_t block_of(uint32_t pixel) const { return pixel / width_ / kBlock * across_ + pixel % width_ / kBlock; }
  Block block_at(uint32_t block) const;
  template <class Work>
  void each_pixel(uint32_t block, const Work& work) const;
  /// On all threads.
  template <class Work>
  void each_drawn(const Work& work) const;
  void leave_out(const Film& film);
  /// Variances of the block's pixels. `counts`: the half's samples were part of the picture.
  void measure(Half& half, bool counts, uint32_t block) const;
  /// The noise of the block's pixels as this half sees it.
  void judge(Half& half, uint32_t block) const;
  void judge_all(Half& half);
  /// Of the block, or of that and those around when they vary more.
  Moments around(const std::vector<Moments>& blocks, uint32_t block) const;
  /// The same for the samples that count.
  Moments picture_moments(const Film& film, const Half& half, uint32_t block) const;
  /// The variance of a pixel by its samples and by what is around it.
  static double likely_variance(const Moments& own, uint32_t samples, bool seen, const Moments& around);
  /// The sky, a lamp: the same every time.
  static bool no_chance(const Moments& own, bool seen) { return own.variance == 0 && (!seen || own.mean > 0); }
  template <class ValueOf>
  float dark_luminance(const ValueOf& value_of) const;

  uint32_t width_, height_, across_, down_;
  NoiseTarget aim_;
  unsigned threads_;
  uint32_t samples_ = 0;              ///< of a half, in the blocks drawn
  Half halves_[2];
  std::vector<uint8_t> counted_;      ///< by block: bit h, half h counts in this pass
  std::vector<uint32_t> drawn_;       ///< blocks of this pass, in the order of tiles
  size_t rendered_count_ = 0;         ///< blocks that are rendered at all
  std::unique_ptr<SpinLock[]> locks_;
};

}  // namespace shoal
