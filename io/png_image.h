// PNG bytes in and out by libpng. Called by decode_image() and write_png() only; see io/image.h for the contract.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "io/image.h"

namespace shoal {

bool is_png(std::span<const std::byte> bytes);
Result<Image8> decode_png(std::span<const std::byte> bytes, const std::string& name, uint64_t max_pixels);

}  // namespace shoal
