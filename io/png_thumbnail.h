// A small copy of a PNG, made row by row: neither the file nor its pixels are ever in memory whole. Called by
// engine/batch_run. Thread rule: plain function. Cost: decompressing the file.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/file.h"
#include "io/result.h"

namespace shoal {

struct Thumbnail {
  uint32_t width = 0, height = 0;
  std::vector<uint8_t> rgb;
};

/// At most `max_side` wide and high, never larger than the picture; each pixel is the mean of those it stands for, as
/// they are coded. Requires: max_side > 0. Fails with: kInput (missing, not a PNG, interlaced), kStorage.
Result<Thumbnail> shrink_png(FileSystem& fs, const std::string& path, uint32_t max_side);

}  // namespace shoal
