#include "engine/adaptive_sampling.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <limits>
#include <mutex>
#include <span>

#include "engine/math.h"
#include "engine/run_on_threads.h"

namespace shoal {
namespace {

/// What was measured is a little off, and what half of the samples say differs from what all say: so one aims below.
constexpr float kAim = 0.95f;
/// How many samples' worth of a pixel's variance is that of its neighbourhood: chosen so that estimates hold at 16
/// samples (docs/adaptive_sampling.md).
constexpr double kPriorWeight = 16;
/// Noise of what is darker is not seen: relative to so much of the median luminance.
/// Of a neighbourhood's variance, what a pixel has that never varied: chosen, a thousandth of the deviation.
constexpr double kLeastShare = 1e-6;
constexpr float kDarkShare = 0.1f;
/// Of pixels that are not rendered or in which nothing is left to chance.
constexpr float kNoNoise = -1;
constexpr uint32_t kBlocksAtOnce = 64;

float luminance(const Vec3& c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }

/// Kish's effective number of samples: of a few bright ones among many black ones only those tell something.
double effective(uint32_t samples, double mean, double variance) {
  const double square = mean * mean;
  return square > 0 ? samples * square / (square + variance) : 0;
}

float relative(double standard_error, double value, double dark) {
  if (standard_error == 0) return 0;
  return static_cast<float>(standard_error / std::max(value, dark));  // infinite in a picture without light
}

float film_luminance(const Film& film, size_t pixel) {
  float rgb[3];
  film.mean(static_cast<uint32_t>(pixel), rgb);
  return luminance({rgb[0], rgb[1], rgb[2]});
}

/// The smallest of the values >= 0 that so large a share of them does not exceed; 0 when there are none.
float quantile(std::span<const float> values, double share) {
  std::vector<uint32_t> bins(1u << 16);
  uint64_t count = 0, rank = 0;
  uint32_t upper = 0;
  const auto find = [&] {
    uint32_t bin = 0;
    for (; bin + 1 < bins.size() && bins[bin] < rank; ++bin) rank -= bins[bin];
    return bin;
  };
  for (const float value : values) {
    if (value >= 0) ++bins[std::bit_cast<uint32_t>(value) >> 16], ++count;
  }
  if (count == 0) return 0;
  rank = std::max<uint64_t>(static_cast<uint64_t>(std::ceil(share * static_cast<double>(count))), 1);
  upper = find();
  std::fill(bins.begin(), bins.end(), 0);
  for (const float value : values) {
    const uint32_t bits = std::bit_cast<uint32_t>(value);
    if (value >= 0 && bits >> 16 == upper) ++bins[bits & 0xffff];
  }
  return std::bit_cast<float>(upper << 16 | find());
}

/// How many times the samples there are it takes until both are met: the error goes with the root of their number.
float times_more(float median, float percentile_95, const NoiseTarget& aim) {
  const float a = median / aim.median, b = percentile_95 / aim.percentile_95;
  return std::max(a * a, b * b);
}

}  // namespace

AdaptiveSampling::AdaptiveSampling(uint32_t width, uint32_t height, const NoiseTarget& target, unsigned threads)
    : width_(width),
      height_(height),
      across_((width + kBlock - 1) / kBlock),
      down_((height + kBlock - 1) / kBlock),
      aim_{kAim * target.median, kAim * target.percentile_95},
      threads_(threads),
      counted_(size_t{across_} * down_, 3),
      locks_(std::make_unique<SpinLock[]>(kLocks)) {
  const size_t pixels = size_t{width} * height, blocks = counted_.size();
  for (Half& half : halves_) {
    half.sums.resize(pixels);
    half.seen.resize(pixels);
    half.noise.assign(pixels, kNoNoise);
    half.variance.resize(pixels);
    half.blocks.assign(blocks, kNothing);
    half.more.resize(blocks);
    half.judging.assign(blocks, 1);
  }
  drawn_ = SampleOrder::blocks_in_order(width, height);
  rendered_count_ = drawn_.size();
}

uint64_t AdaptiveSampling::bytes(uint32_t width, uint32_t height) {
  const uint64_t pixels = uint64_t{width} * height;
  const uint64_t blocks = uint64_t{(width + kBlock - 1) / kBlock} * ((height + kBlock - 1) / kBlock);
  const uint64_t half = pixels * (sizeof(Sums) + 1 + 2 * sizeof(float)) + blocks * (sizeof(Moments) + sizeof(float) + 1);
  const uint64_t finishing = 3 * pixels * sizeof(float) + 2 * blocks * sizeof(Moments) + (sizeof(uint32_t) << 16);
  return 2 * half + blocks * (1 + sizeof(uint32_t)) + SampleOrder::bytes_of_blocks(blocks) +
         kLocks * sizeof(SpinLock) + finishing;
}

AdaptiveSampling::Block AdaptiveSampling::block_at(uint32_t block) const {
  const uint32_t x = block % across_ * kBlock, y = block / across_ * kBlock;
  return {x, y, std::min(x + kBlock, width_), std::min(y + kBlock, height_)};
}

template <class Work>
void AdaptiveSampling::each_pixel(uint32_t block, const Work& work) const {
  const Block b = block_at(block);
  for (uint32_t y = b.y0; y < b.y1; ++y) {
    for (uint32_t x = b.x0; x < b.x1; ++x) work(size_t{y} * width_ + x);
  }
}

template <class Work>
void AdaptiveSampling::each_drawn(const Work& work) const {
  std::atomic<size_t> next{0};
  run_on_threads(threads_, [&](unsigned) {
    for (size_t first = next.fetch_add(kBlocksAtOnce); first < drawn_.size(); first = next.fetch_add(kBlocksAtOnce)) {
      const size_t last = std::min(first + kBlocksAtOnce, drawn_.size());
      for (size_t i = first; i < last; ++i) work(drawn_[i]);
    }
  });
}

void AdaptiveSampling::add(uint32_t pixel, uint32_t sample, const Vec3& radiance, bool covered) {
  const float value = std::clamp(luminance(radiance), -Film::kMaxRadiance, Film::kMaxRadiance);
  const FixedPoint128 fixed = FixedPoint128::from_float(value);
  Half& half = halves_[half_of(sample)];
  Sums& sums = half.sums[pixel];
  std::lock_guard guard(locks_[pixel % kLocks]);
  sums.sum.add(fixed);
  sums.squares.add_square(value);
  if (covered) half.seen[pixel] = 1;
}

void AdaptiveSampling::leave_out(const Film& film) {
  std::erase_if(drawn_, [&](uint32_t block) {
    const Block b = block_at(block);
    const bool out = film.added(size_t{b.y0} * width_ + b.x0) == 0;
    if (out) halves_[0].judging[block] = halves_[1].judging[block] = 0;
    return out;
  });
  rendered_count_ = drawn_.size();
}

void AdaptiveSampling::end_pass(const Film& film, uint32_t samples) {
  if (samples_ == 0) leave_out(film);
  samples_ = samples / 2;
  if (samples_ < 2) return;
  each_drawn([&](uint32_t block) {
    for (uint32_t h = 0; h < 2; ++h) measure(halves_[h], (counted_[block] >> h & 1) != 0, block);
  });
  if (samples_ < kPilot) return;
  for (Half& half : halves_) judge_all(half);
  std::erase_if(drawn_, [&](uint32_t block) {
    // What a half has judged is done to the other.
    counted_[block] = static_cast<uint8_t>(halves_[1].judging[block] | halves_[0].judging[block] << 1);
    return counted_[block] == 0;
  });
}

void AdaptiveSampling::measure(Half& half, bool counts, uint32_t block) const {
  Moments sum;
  uint32_t seen = 0;
  each_pixel(block, [&](size_t pixel) {
    const Sums& sums = half.sums[pixel];
    const double variance = sample_variance(sums.sum, sums.squares, samples_);
    if (counts) half.variance[pixel] = static_cast<float>(variance);
    if (half.judging[block] != 0) half.noise[pixel] = static_cast<float>(variance);  // for judge()
    if (half.seen[pixel] == 0) return;
    sum.mean += sums.sum.to_double() / samples_, sum.variance += variance, ++seen;
  });
  if (half.judging[block] == 0) return;
  half.blocks[block] = seen > 0 ? Moments{sum.mean / seen, sum.variance / seen} : kNothing;
}

AdaptiveSampling::Moments AdaptiveSampling::around(const std::vector<Moments>& blocks, uint32_t block) const {
  const uint32_t bx = block % across_, by = block / across_;
  Moments sum;
  uint32_t count = 0;
  for (uint32_t y = by - std::min(by, 1u); y <= std::min(by + 1, down_ - 1); ++y) {
    for (uint32_t x = bx - std::min(bx, 1u); x <= std::min(bx + 1, across_ - 1); ++x) {
      const Moments& other = blocks[size_t{y} * across_ + x];
      if (other.variance >= 0) sum.mean += other.mean, sum.variance += other.variance, ++count;
    }
  }
  const Moments all = count > 0 ? Moments{sum.mean / count, sum.variance / count} : kNothing;
  return all.variance > blocks[block].variance ? all : blocks[block];
}

double AdaptiveSampling::likely_variance(const Moments& own, uint32_t samples, bool seen, const Moments& around) {
  if (!seen || no_chance(own, seen)) return own.variance;
  if (around.variance <= own.variance) {
    const double freedom = samples - 1.0;
    return (freedom * own.variance + kPriorWeight * std::max(around.variance, 0.0)) / (freedom + kPriorWeight);
  }
  // Its neighbours say whether nothing found means that there is nothing.
  const double told = std::max(effective(samples, own.mean, own.variance),
                               effective(samples, around.mean, around.variance));
  const double freedom = std::max(told - 1, 0.0), share = std::max(own.variance / around.variance, kLeastShare);
  return around.variance * power_of(static_cast<float>(share), static_cast<float>(freedom / (freedom + kPriorWeight)));
}

void AdaptiveSampling::judge(Half& half, uint32_t block) const {
  const Moments neighbourhood = around(half.blocks, block);
  std::array<float, kBlock * kBlock> noise;
  uint32_t count = 0;
  each_pixel(block, [&](size_t pixel) {
    const Moments own{half.sums[pixel].sum.to_double() / samples_, half.noise[pixel]};
    const bool seen = half.seen[pixel] != 0;
    const double variance = likely_variance(own, samples_, seen, neighbourhood);
    half.noise[pixel] = kNoNoise;
    if (no_chance(own, seen)) return;
    noise[count++] = half.noise[pixel] = relative(std::sqrt(variance / (2.0 * samples_)), own.mean, half.dark);
  });
  const auto quantile_of = [&](double share) {
    const auto at = noise.begin() + static_cast<ptrdiff_t>(std::ceil(share * count)) - 1;
    std::nth_element(noise.begin(), at, noise.begin() + count);
    return *at;
  };
  half.more[block] = 0;
  if (count > 0) half.more[block] = times_more(quantile_of(0.5), quantile_of(0.95), aim_);
}

void AdaptiveSampling::judge_all(Half& half) {
  if (half.dark < 0) {  // once, while all blocks are drawn for this half alone
    half.dark = dark_luminance([&](size_t pixel) {
      return static_cast<float>(half.sums[pixel].sum.to_double() / samples_);
    });
  }
  each_drawn([&](uint32_t block) {
    if (half.judging[block] != 0) judge(half, block);
  });
  half.more_of_all = times_more(quantile(half.noise, 0.5), quantile(half.noise, 0.95), aim_);
  for (const uint32_t block : drawn_) {
    if (half.more[block] <= 1 || half.more_of_all <= 1) half.judging[block] = 0;
  }
}

template <class ValueOf>
float AdaptiveSampling::dark_luminance(const ValueOf& value_of) const {
  std::vector<float> lit(size_t{width_} * height_, kNoNoise);
  for (size_t pixel = 0; pixel < lit.size(); ++pixel) {
    const float value = value_of(pixel);
    if (value > 0) lit[pixel] = value;
  }
  return kDarkShare * quantile(lit, 0.5);
}

uint64_t AdaptiveSampling::drawn_pixels() const {
  uint64_t pixels = 0;
  for (const uint32_t block : drawn_) {
    const Block b = block_at(block);
    pixels += uint64_t{b.x1 - b.x0} * (b.y1 - b.y0);
  }
  return pixels;
}

uint64_t AdaptiveSampling::expected_samples(uint32_t most) const {
  double sum = 0;
  for (const uint32_t block : drawn_) {
    double times = 1;
    for (const Half& half : halves_) {
      if (half.judging[block] != 0) times = std::max<double>(times, std::min(half.more[block], half.more_of_all));
    }
    const Block b = block_at(block);
    const double wanted = (times - 1) * 2 * samples_, left = most - 2.0 * samples_;
    sum += std::min(std::max(0.0, wanted), std::max(0.0, left)) * ((b.x1 - b.x0) * (b.y1 - b.y0));  // 0 where wanted is no number
  }
  return static_cast<uint64_t>(sum);
}

AdaptiveSampling::Moments AdaptiveSampling::picture_moments(const Film& film, const Half& half, uint32_t block) const {
  Moments sum;
  uint32_t seen = 0;
  each_pixel(block, [&](size_t pixel) {
    if (half.seen[pixel] == 0) return;
    sum.mean += film_luminance(film, pixel), sum.variance += half.variance[pixel], ++seen;
  });
  return seen > 0 ? Moments{sum.mean / seen, sum.variance / seen} : kNothing;
}

std::optional<NoiseReached> AdaptiveSampling::finish(const Film& film, std::vector<float>& errors) const {
  if (samples_ < 2) return std::nullopt;
  const size_t pixels = size_t{width_} * height_, blocks = counted_.size();
  std::vector<Moments> moments[2];
  for (uint32_t h = 0; h < 2; ++h) {
    moments[h].resize(blocks);
    for (uint32_t block = 0; block < blocks; ++block) moments[h][block] = picture_moments(film, halves_[h], block);
  }
  const float dark = dark_luminance([&](size_t pixel) { return film_luminance(film, pixel); });
  errors.assign(pixels, 0);
  std::vector<float> noise(pixels, kNoNoise);
  for (uint32_t block = 0; block < blocks; ++block) {
    const Moments neighbourhoods[2] = {around(moments[0], block), around(moments[1], block)};
    each_pixel(block, [&](size_t pixel) {
      if (film.added(pixel) == 0) return;
      const float value = film_luminance(film, pixel);
      const bool seen = (halves_[0].seen[pixel] | halves_[1].seen[pixel]) != 0;
      double sum = 0;
      bool chance = false;
      for (uint32_t h = 0; h < 2; ++h) {
        const uint32_t added = film.added(pixel, h);
        const Moments own{value, halves_[h].variance[pixel]};
        sum += likely_variance(own, added, seen, neighbourhoods[h]) / added;
        chance = chance || !no_chance(own, seen);
      }
      errors[pixel] = static_cast<float>(std::sqrt(sum / 4));
      if (chance) noise[pixel] = relative(errors[pixel], value, dark);
    });
  }
  return NoiseReached{quantile(noise, 0.5), quantile(noise, 0.95)};
}

}  // namespace shoal
