// Two pictures compared: identical to the bit, or by how much not. Called by `shoal diff`, compare and tests.
// Plain functions, any thread. Cost: one pass over the channels that both pictures have.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/image.h"

namespace shoal {

struct ImageDiffOptions {
  /// Cost maps (kCostChannelPrefixes) depend on the order of traversal by design; they are left out unless asked
  /// for.
  bool cost_maps = false;
  bool flip = false;  ///< HDR-FLIP of R, G and B as well (engine/flip); takes seconds a megapixel
};

inline constexpr const char* kCostChannelPrefixes[] = {"treelets.", "bytes.", "time."};

/// `a` is the picture tested, `b` the reference. Values that are not finite in either are counted, not summed.
struct ChannelDiff {
  std::string name;
  uint64_t differing_count = 0;  ///< values whose bits differ
  uint64_t non_finite_count = 0;
  double max_absolute = 0;  ///< max |a - b|
  double max_relative = 0;  ///< max |a - b| / max(|a|, |b|)
  double mean = 0;          ///< mean of a - b
  double rmse = 0;          ///< sqrt(mean of (a - b)^2)
  double relative_mse = 0;  ///< mean of (a - b)^2 / (b^2 + 0.01), Rousselle et al. 2011, section 6
};

struct ImageDiff {
  bool comparable = false;         ///< same data window
  bool identical = false;          ///< comparable, the same channels, every bit equal
  std::vector<std::string> notes;  ///< what keeps them from being compared in full: sizes, channels of one only
  uint64_t pixels_count = 0;
  uint64_t differing_pixels_count = 0;
  std::vector<ChannelDiff> channels;  ///< of both, by name
  ChannelDiff color;                  ///< R, G and B together
  std::optional<double> mean_flip;    ///< where it was asked for and both have R, G and B

  struct First {
    bool found = false;
    uint32_t x = 0, y = 0;  ///< in the data window, rows from the top
    std::string channel;
    float a = 0, b = 0;
  } first;  ///< first pixel that differs, in reading order, then by channel name
};

ImageDiff diff_images(const ExrImage& a, const ExrImage& b, const ImageDiffOptions& options = {});

/// A few lines for people, without a line break at the end.
std::string diff_text(const ImageDiff& diff);
/// One JSON object (schema in docs/measuring.md).
std::string diff_json(const ImageDiff& diff);

}  // namespace shoal
