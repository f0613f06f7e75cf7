// Encoded pictures for the tests of the decoders, made with the same libraries' encoders.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace shoal {

/// A PNG of rows of `bytes` as they go to libpng (16-bit big-endian, packed below 8 bits). `palette` is RGB RGB
/// ..., `transparent` a tRNS of palette alphas, or for other colour types non-empty for the colour 0.
std::vector<std::byte> make_png(uint32_t width, uint32_t height, int color_type, int bit_depth, bool interlaced,
                                const std::vector<uint8_t>& bytes, const std::vector<uint8_t>& palette = {},
                                const std::vector<uint8_t>& transparent = {});

/// `components`: 1 grey, 3 RGB, 4 CMYK.
std::vector<std::byte> make_jpeg(uint32_t width, uint32_t height, int components, bool progressive,
                                 const std::vector<uint8_t>& pixels);

/// RGBA, without loss or with it.
std::vector<std::byte> make_webp(uint32_t width, uint32_t height, bool lossless, const std::vector<uint8_t>& rgba);

}  // namespace shoal
