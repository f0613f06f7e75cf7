#include "engine/picture_error.h"

#include <algorithm>
#include <cmath>

#include "io/result.h"

namespace shoal {
namespace {

constexpr double kRelativeBias = 0.01;  ///< that of engine/image_diff
constexpr uint32_t kBlock = 16;
constexpr double kTwoSided95 = 1.959964, kTwoSided99 = 2.575829;  ///< of the normal distribution

double weight_of(double reference) { return 1 / (reference * reference + kRelativeBias); }

/// Count, mean and sum of squared deviations of a few values, and the same without one of them.
struct Spread {
  double count = 0, mean = 0, squares = 0;

  /// Unbiased; 0 for a single value.
  double variance() const { return count > 1 ? squares / (count - 1) : 0; }
  Spread without(double value) const {
    const double mean_left = (count * mean - value) / (count - 1);
    return {count - 1, mean_left, std::max(squares - (value - mean) * (value - mean_left), 0.0)};
  }
};

Spread spread_of(std::span<const RgbPicture> pictures, size_t at) {
  Spread spread;
  spread.count = static_cast<double>(pictures.size());
  for (const RgbPicture& picture : pictures) spread.mean += picture[at];
  spread.mean /= spread.count;
  for (const RgbPicture& picture : pictures) spread.squares += (picture[at] - spread.mean) * (picture[at] - spread.mean);
  return spread;
}

double bias_squared(const Spread& seen, const Spread& reference, double reference_variance) {
  const double difference = seen.mean - reference.mean;
  return difference * difference - seen.variance() / seen.count - reference_variance;
}

/// Sums over a block: as it is, and with each of the pictures left out.
struct Leaving {
  double whole = 0;
  std::vector<double> without;

  explicit Leaving(size_t pictures) : without(pictures, 0.0) {}
  /// The jackknife's variance of `whole`.
  double variance() const {
    if (without.size() < 2) return 0;
    const double n = static_cast<double>(without.size());
    double mean = 0, sum = 0;
    for (const double value : without) mean += value / n;
    for (const double value : without) sum += (value - mean) * (value - mean);
    return (n - 1) / n * sum;
  }
};

struct Sums {
  double variance = 0, bias = 0;              ///< sums over all pixels
  double variance_noise = 0, bias_noise = 0;  ///< variances of those
};

class Blocks {
 public:
  Blocks(uint32_t width, std::span<const RgbPicture> pictures, const ReferencePicture& reference)
      : width_(width), pictures_(pictures), reference_(reference) {}

  void add(uint32_t x0, uint32_t y0, uint32_t x1, uint32_t y1) {
    Leaving variance(pictures_.size()), bias(pictures_.size()), parts(reference_.parts.size());
    for (uint32_t y = y0; y < y1; ++y) {
      for (size_t at = (size_t{y} * width_ + x0) * 3; at < (size_t{y} * width_ + x1) * 3; ++at) {
        add_value(at, variance, bias, parts);
      }
    }
    sums.variance += variance.whole;
    sums.bias += bias.whole;
    sums.variance_noise += variance.variance();
    // With two parts one left out has no variance of its own.
    sums.bias_noise += bias.variance() + (reference_.parts.size() > 2 ? parts.variance() : 0);
  }

  Sums sums;

 private:
  void add_value(size_t at, Leaving& variance, Leaving& bias, Leaving& parts) const {
    const Spread seen = spread_of(pictures_, at), truth = spread_of(reference_.parts, at);
    const double known = reference_.variance.empty() ? 0 : reference_.variance[at];
    const double truth_variance = truth.count > 1 ? truth.variance() / truth.count : known;
    const double weight = reference_.weights[at];
    variance.whole += weight * seen.variance();
    bias.whole += weight * bias_squared(seen, truth, truth_variance);
    for (size_t k = 0; k < pictures_.size(); ++k) {
      const Spread left = seen.without(pictures_[k][at]);
      variance.without[k] += weight * left.variance();
      bias.without[k] += weight * bias_squared(left, truth, truth_variance);
    }
    if (reference_.parts.size() < 3) return;
    for (size_t k = 0; k < reference_.parts.size(); ++k) {
      const Spread left = truth.without(reference_.parts[k][at]);
      parts.without[k] += weight * bias_squared(seen, left, left.variance() / left.count);
    }
  }

  uint32_t width_;
  std::span<const RgbPicture> pictures_;
  const ReferencePicture& reference_;
};

Estimate estimate(double sum, double variance, double values) {
  const double reach = kTwoSided95 * std::sqrt(variance);
  return {sum / values, (sum - reach) / values, (sum + reach) / values};
}

/// By the mean of the pixels around, at most eight; of a lone pixel by itself.
RgbPicture weights_around(uint32_t width, uint32_t height, const RgbPicture& mean) {
  RgbPicture weights(mean.size());
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      for (size_t c = 0; c < 3; ++c) {
        const size_t own = (size_t{y} * width + x) * 3 + c;
        double sum = 0, count = 0;
        for (uint32_t j = y == 0 ? 0 : y - 1; j <= std::min(y + 1, height - 1); ++j) {
          for (uint32_t i = x == 0 ? 0 : x - 1; i <= std::min(x + 1, width - 1); ++i) {
            const size_t at = (size_t{j} * width + i) * 3 + c;
            if (at != own) sum += mean[at], ++count;
          }
        }
        weights[own] = static_cast<float>(weight_of(count > 0 ? sum / count : mean[own]));
      }
    }
  }
  return weights;
}

}  // namespace

RelativeError relative_error(std::span<const float> picture, std::span<const float> reference) {
  SHOAL_CHECK(picture.size() == reference.size() && picture.size() % 3 == 0 && !picture.empty());
  std::vector<double> errors(picture.size() / 3);
  RelativeError error;
  for (size_t i = 0; i < errors.size(); ++i) {
    for (size_t c = i * 3; c < i * 3 + 3; ++c) {
      const double d = static_cast<double>(picture[c]) - reference[c];
      errors[i] += d * d * weight_of(reference[c]) / 3;
    }
    error.all += errors[i];
  }
  const size_t kept = errors.size() - static_cast<size_t>(std::llround(static_cast<double>(errors.size()) * kTrimmedShare));
  std::nth_element(errors.begin(), errors.begin() + static_cast<ptrdiff_t>(kept - 1), errors.end());
  for (size_t i = 0; i < kept; ++i) error.trimmed += errors[i];
  error.all /= static_cast<double>(errors.size());
  error.trimmed /= static_cast<double>(kept);
  return error;
}

ReferencePicture reference_of(uint32_t width, uint32_t height, std::vector<RgbPicture> parts) {
  SHOAL_CHECK(!parts.empty());
  for (const RgbPicture& part : parts) SHOAL_CHECK(part.size() == size_t{width} * height * 3);
  ReferencePicture reference;
  reference.mean.resize(parts.front().size());
  for (size_t i = 0; i < reference.mean.size(); ++i) {
    double sum = 0;
    for (const RgbPicture& part : parts) sum += part[i];
    reference.mean[i] = static_cast<float>(sum / static_cast<double>(parts.size()));
  }
  reference.weights = weights_around(width, height, reference.mean);
  reference.parts = std::move(parts);
  return reference;
}

double ReferencePicture::relative_noise() const {
  if (!noise_known()) return 0;
  double sum = 0;
  for (size_t i = 0; i < mean.size(); ++i) {
    const Spread truth = spread_of(parts, i);
    sum += weights[i] * (truth.count > 1 ? truth.variance() / truth.count : variance[i]);
  }
  return sum / static_cast<double>(mean.size());
}

NoiseAndBias noise_and_bias(uint32_t width, uint32_t height, std::span<const RgbPicture> pictures,
                            const ReferencePicture& reference) {
  const size_t values = size_t{width} * height * 3;
  SHOAL_CHECK(pictures.size() >= kFewestSeeds && reference.mean.size() == values);
  for (const RgbPicture& picture : pictures) SHOAL_CHECK(picture.size() == values);
  Blocks blocks(width, pictures, reference);
  for (uint32_t y = 0; y < height; y += kBlock) {
    for (uint32_t x = 0; x < width; x += kBlock) {
      blocks.add(x, y, std::min(x + kBlock, width), std::min(y + kBlock, height));
    }
  }
  const Sums& sums = blocks.sums;
  NoiseAndBias found;
  found.variance = estimate(sums.variance, sums.variance_noise, static_cast<double>(values));
  found.bias_squared = estimate(sums.bias, sums.bias_noise, static_cast<double>(values));
  found.biased = sums.bias > kTwoSided99 * std::sqrt(sums.bias_noise);
  return found;
}

}  // namespace shoal
