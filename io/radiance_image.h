// Radiance .hdr pictures (Ward, "Real Pixels", Graphics Gems II, 1991; flat, old and new run lengths).
// Called by read_hdr_image() and hdr_image_size() only; see io/image.h for the contract.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "io/image.h"

namespace shoal {

bool is_radiance(std::span<const std::byte> bytes);
/// Width and height alone.
Result<ImageF> decode_radiance_header(std::span<const std::byte> bytes, const std::string& name, uint64_t max_pixels);
Result<ImageF> decode_radiance(std::span<const std::byte> bytes, const std::string& name, uint64_t max_pixels);

}  // namespace shoal
