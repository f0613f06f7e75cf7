// PNG bytes in and out by libpng. Called by decode_image(), by write_png() (see io/image.h for the contract of both), and
// for the pictures of report pages.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "io/image.h"

namespace shoal {

bool is_png(std::span<const std::byte> bytes);
Result<Image8> decode_png(std::span<const std::byte> bytes, const std::string& name, uint64_t max_pixels);
/// 8-bit sRGB-encoded RGB as the bytes of a PNG. Requires: 3 * width * height bytes. Fails with: kInternal.
Result<std::vector<std::byte>> encode_png(uint32_t width, uint32_t height, std::span<const uint8_t> rgb);

}  // namespace shoal
