// How far a rendered picture is from a reference: the relative squared error, and what of it is noise and what bias,
// told apart by several pictures with different seeds. Called by engine/accuracy and tests. Plain functions, any thread.
//
// A value x of a picture and r of the reference differ by (x - r)^2 w, w = 1 / (r^2 + 0.01) (Rousselle, Knaus, Zwicker
// 2011, section 6, as engine/image_diff has it); all means are over pixels and R, G, B. Noise and bias are weighed by the
// mean of the eight pixels around instead of r: a weight that shares the noise of r is larger where r came out too dark,
// and would show a bias where there is none.
//   variance      of one picture: the mean of w s^2, with s^2 the sample variance between the seeds;
//   bias squared  the mean of w ((m - r)^2 - s^2 / K - t^2 / R), with m the mean of K pictures and t^2 the variance
//                 between the R parts of the reference: what is left of the error of the mean once the noise of both
//                 means is taken off. Unbiased: around 0, so also below it, where there is no bias.
// Intervals are by the jackknife (Efron, Stein 1981, "The Jackknife Estimate of Variance", Annals of Statistics 9(3)): one
// seed at a time left out, in blocks of 16 x 16 pixels, whose noise is independent; the variances of all blocks add up.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace shoal {

/// Three values a pixel, rows from the top.
using RgbPicture = std::vector<float>;

/// Share of the pixels, those of largest error, that a trimmed mean leaves out: single fireflies would rule it.
inline constexpr double kTrimmedShare = 0.001;

struct RelativeError {
  double all = 0;
  double trimmed = 0;  ///< at least one pixel is left out, from 500 pixels on
};
RelativeError relative_error(std::span<const float> picture, std::span<const float> reference);

/// What pictures are compared with.
struct ReferencePicture {
  std::vector<RgbPicture> parts;  ///< of different seeds, all with the same number of samples; at least one
  RgbPicture mean;                ///< of the parts
  RgbPicture weights;             ///< w of every value, by the pixels around it
  /// Of the mean; empty: not known, counts as none. Only asked for where there is one part.
  RgbPicture variance;

  bool noise_known() const { return parts.size() > 1 || !variance.empty(); }
  /// The mean of w times the variance of `mean`; 0 where it is not known.
  double relative_noise() const;
};
ReferencePicture reference_of(uint32_t width, uint32_t height, std::vector<RgbPicture> parts);

/// With the interval that holds the true value 95 times in 100.
struct Estimate {
  double value = 0, low = 0, high = 0;
};

struct NoiseAndBias {
  Estimate variance;
  Estimate bias_squared;
  /// The lower end of the interval that holds it 99 times in 100 is above 0.
  bool biased = false;
};
/// Requires: at least kFewestSeeds pictures of width x height, and a reference of that size.
NoiseAndBias noise_and_bias(uint32_t width, uint32_t height, std::span<const RgbPicture> pictures,
                            const ReferencePicture& reference);
inline constexpr uint32_t kFewestSeeds = 3;  ///< with one left out there is a variance still

}  // namespace shoal
