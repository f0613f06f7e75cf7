// JPEG bytes by libjpeg-turbo. Called by decode_image() only; see io/image.h for the contract.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "io/image.h"

namespace shoal {

bool is_jpeg(std::span<const std::byte> bytes);
/// Grey and YCbCr; EXIF orientation is ignored, as glTF asks.
Result<Image8> decode_jpeg(std::span<const std::byte> bytes, const std::string& name, uint64_t max_pixels);

}  // namespace shoal
