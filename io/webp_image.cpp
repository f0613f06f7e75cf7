#include "io/webp_image.h"

#include <fmt/format.h>
#include <webp/decode.h>

#include <cstring>

namespace shoal {

namespace {

const uint8_t* octets(std::span<const std::byte> bytes) { return reinterpret_cast<const uint8_t*>(bytes.data()); }

}  // namespace

bool is_webp(std::span<const std::byte> bytes) {
  return bytes.size() >= 12 && std::memcmp(bytes.data(), "RIFF", 4) == 0 && std::memcmp(&bytes[8], "WEBP", 4) == 0;
}

WebpSize read_webp_size(std::span<const std::byte> bytes) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(octets(bytes), bytes.size(), &features) != VP8_STATUS_OK) return {};
  return {static_cast<uint32_t>(features.width), static_cast<uint32_t>(features.height), features.has_alpha != 0};
}

Result<Image8> decode_webp(std::span<const std::byte> bytes, const std::string& name, uint64_t max_pixels) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(octets(bytes), bytes.size(), &features) != VP8_STATUS_OK) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected a WebP, found a broken header", name)};
  }
  if (features.has_animation != 0) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected a still WebP, found an animation", name)};
  }
  Image8 image;
  image.width = static_cast<uint32_t>(features.width);
  image.height = static_cast<uint32_t>(features.height);
  image.has_alpha = features.has_alpha != 0;
  const uint64_t pixels = uint64_t{image.width} * image.height;
  if (pixels > max_pixels) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected at most {} pixels, found {} x {}", name, max_pixels,
                                                image.width, image.height)};
  }
  image.rgba.resize(pixels * 4);
  const int stride = static_cast<int>(image.width) * 4;
  if (WebPDecodeRGBAInto(octets(bytes), bytes.size(), image.rgba.data(), image.rgba.size(), stride) == nullptr) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected a WebP, found broken or missing pixels", name)};
  }
  return image;
}

}  // namespace shoal
