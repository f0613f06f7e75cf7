// A look at an OpenEXR header before the library sees the file: Debian's OpenEXR allocates what a header asks for,
// so sizes are bounded here first. Called before read_exr() and its like. Cost: a few small reads.
#pragma once

#include <cstdint>

#include "io/file.h"
#include "io/result.h"

namespace shoal {

/// More than any layer of ours, and few enough that a header cannot ask for memory without end.
inline constexpr uint32_t kMaxExrChannels = 256;

bool is_exr(ReadableFile& file);

struct ExrSize {
  uint32_t width, height, channel_count;  ///< of the data window
};

/// Refuses what we do not read (tiles, deep data, several parts, lossy block codecs) and what is too large: more
/// than max_pixels pixels in the data window, more than 4 * max_pixels values in all channels, attributes that
/// leave the file. Fails with: kInput, kStorage.
Result<ExrSize> check_exr_header(ReadableFile& file, uint64_t max_pixels);

}  // namespace shoal
