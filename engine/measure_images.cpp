#include "engine/measure_images.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "engine/tile_textures.h"
#include "io/jpeg_image.h"
#include "io/webp_image.h"

namespace shoal {
namespace {

/// Colour profiles and thumbnails of a JPEG lie before its size.
constexpr uint64_t kHeaderBytes = 1u << 20;

uint32_t big_endian(std::span<const std::byte> bytes, size_t at, int count) {
  uint32_t value = 0;
  for (int i = 0; i < count; ++i) value = value << 8 | std::to_integer<uint32_t>(bytes[at + static_cast<size_t>(i)]);
  return value;
}

/// ITU T.81, annex B: segments until a frame header (SOF0 to SOF15, but DHT, JPG and DAC).
ImageHeader read_jpeg_header(std::span<const std::byte> bytes) {
  for (size_t at = 2; at + 9 <= bytes.size();) {
    if (bytes[at] != std::byte{0xff}) break;
    const uint32_t marker = std::to_integer<uint32_t>(bytes[at + 1]);
    if (marker == 0xff) {  // a fill byte
      ++at;
      continue;
    }
    if (marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc) {
      return {big_endian(bytes, at + 7, 2), big_endian(bytes, at + 5, 2), false};
    }
    at += 2 + big_endian(bytes, at + 2, 2);
  }
  return {};
}

struct EncodedHead {
  std::vector<std::byte> bytes;
  uint64_t encoded_bytes = 0;
};

Result<EncodedHead> read_head(FileSystem& fs, gltf::BufferFiles& files, const gltf::Document& document,
                              const gltf::Image& image) {
  EncodedHead head;
  if (image.view) {
    const gltf::BufferView& view = document.views[*image.view];
    head.encoded_bytes = view.byte_length;
    head.bytes.resize(std::min(head.encoded_bytes, kHeaderBytes));
    SHOAL_RETURN_IF_ERROR(files.read(view.buffer, view.byte_offset, head.bytes));
  } else if (!image.path.empty()) {
    SHOAL_ASSIGN_OR_RETURN(const auto file, fs.open(image.path, ReadMode::kBuffered));
    head.encoded_bytes = file->size_bytes();
    head.bytes.resize(std::min(head.encoded_bytes, kHeaderBytes));
    SHOAL_RETURN_IF_ERROR(file->read_at(0, head.bytes));
  } else {
    head.encoded_bytes = image.embedded.size();
    head.bytes.assign(image.embedded.begin(),
                      image.embedded.begin() + static_cast<ptrdiff_t>(std::min(head.encoded_bytes, kHeaderBytes)));
  }
  return head;
}

Status check_header(const EncodedHead& head, const ImageHeader& header, const std::string& name, uint64_t most_pixels) {
  if (head.encoded_bytes > kMaxEncodedImageBytes) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected at most {} encoded bytes, found {}", name,
                                                kMaxEncodedImageBytes, head.encoded_bytes)};
  }
  const uint64_t pixels = uint64_t{header.width} * header.height;
  if (pixels == 0 && !is_jpeg(head.bytes)) {
    return Error{ErrorCode::kInput,
                 fmt::format("{}: expected a PNG, a JPEG or a WebP, found another format or no size", name)};
  }
  if (pixels > most_pixels) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected at most {} pixels, found {} x {}", name, most_pixels,
                                                header.width, header.height)};
  }
  if (std::max(header.width, header.height) > kMaxTextureSide) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected 1 to {} texels a side, found {} x {}", name,
                                                kMaxTextureSide, header.width, header.height)};
  }
  return {};
}

}  // namespace

Error image_error(const gltf::Document& document, const TextureRequest& request, const Error& error) {
  return {error.code, fmt::format("{}: images[{}] ({}), used by {}: {}", document.path, request.image,
                                  document.images[request.image].name, request.user, error.message)};
}

ImageHeader read_image_header(std::span<const std::byte> bytes) {
  constexpr unsigned char kPng[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  if (bytes.size() >= 24 && std::memcmp(bytes.data(), kPng, 8) == 0) {
    return {big_endian(bytes, 16, 4), big_endian(bytes, 20, 4), true};
  }
  if (bytes.size() >= 2 && bytes[0] == std::byte{0xff} && bytes[1] == std::byte{0xd8}) return read_jpeg_header(bytes);
  if (is_webp(bytes)) {
    const WebpSize size = read_webp_size(bytes);
    return {size.width, size.height, size.has_alpha};
  }
  return {};
}

Result<ImageNeeds> measure_images(FileSystem& fs, gltf::BufferFiles& files, const gltf::Document& document,
                                  const std::vector<TextureRequest>& requests, uint64_t most_pixels) {
  ImageNeeds needs;
  for (size_t r = 0; r < requests.size(); ++r) {
    const gltf::Image& image = document.images[requests[r].image];
    const auto head = read_head(fs, files, document, image);
    if (!head.ok()) return image_error(document, requests[r], head.error());
    const ImageHeader header = read_image_header(head.value().bytes);
    if (const Status status = check_header(head.value(), header, image.name, most_pixels); !status.ok()) {
      return image_error(document, requests[r], status.error());
    }
    const uint64_t pixels = uint64_t{header.width} * header.height;
    // The encoded bytes are there twice while a file is read.
    needs.largest_bytes =
        std::max(needs.largest_bytes, pixels * kImageScratchBytesPerPixel + 2 * head.value().encoded_bytes);
    if (requests[r].needs_alpha && header.may_have_alpha) needs.coverage_bytes += pixels + pixels / 2;
  }
  return needs;
}

}  // namespace shoal
