// What `--target-noise` asks for and what was reached: relative standard errors of pixels, as engine/adaptive_sampling.h
// estimates them. Called by bins/command_render, engine/render and engine/adaptive_sampling. Plain values.
#pragma once

#include <string>

#include "io/result.h"

namespace shoal {

struct NoiseTarget {
  float median = 0;         ///< at half of the pixels at most; 0: nothing is asked for
  float percentile_95 = 0;  ///< at 95 % of the pixels at most

  bool asked() const { return median > 0; }
};

struct NoiseReached {
  float median = 0, percentile_95 = 0;

  bool meets(const NoiseTarget& target) const {
    return median <= target.median && percentile_95 <= target.percentile_95;
  }
};

/// "0.02", "2%", "2%:5%": the median and, after a colon, the 95th percentile, which is twice the median without one.
/// Empty: nothing. Fails with: kUsage.
Result<NoiseTarget> parse_noise_target(const std::string& text);

}  // namespace shoal
