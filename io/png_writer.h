// A PNG with an alpha channel, written without a compression library: deflate's stored blocks only, so that
// generated textures have the same bytes whatever zlib the machine has. Called by engine/generate_*. Cost: 4 bytes
// a pixel.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "io/file.h"

namespace shoal {

/// 8-bit RGBA, rows from the top, atomically. Requires: rgba of 4 * width * height bytes, width and height in
/// 1 .. 16384. Fails with: kStorage.
Status write_png_rgba(FileSystem& fs, const std::string& path, uint32_t width, uint32_t height,
                      std::span<const uint8_t> rgba);

}  // namespace shoal
