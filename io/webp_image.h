// WebP pictures for io/image.cpp and engine/measure_images; libwebp stays inside the .cpp. Its decoder computes in
// integers: the same bits on every processor.
#pragma once

#include "io/image.h"

namespace shoal {

bool is_webp(std::span<const std::byte> bytes);
/// Fails with: kInput (also for an animation).
Result<Image8> decode_webp(std::span<const std::byte> bytes, const std::string& name, uint64_t max_pixels);

struct WebpSize {
  uint32_t width = 0, height = 0;
  bool has_alpha = false;
};
/// From the beginning of a file; zero where it does not say.
WebpSize read_webp_size(std::span<const std::byte> bytes);

}  // namespace shoal
