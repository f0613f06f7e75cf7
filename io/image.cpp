#include "io/image.h"

#include <fmt/format.h>

#include <algorithm>

#include "io/exr_header.h"
#include "io/jpeg_image.h"
#include "io/png_image.h"
#include "io/radiance_image.h"

namespace shoal {

namespace {

/// An .hdr cannot be larger than its pixels and a header, whatever its run lengths.
constexpr uint64_t kMaxHeaderBytes = 1u << 20;

const ExrChannel* find_channel(const ExrImage& image, const char* name) {
  const auto it = std::find_if(image.channels.begin(), image.channels.end(),
                               [&](const ExrChannel& channel) { return channel.name == name; });
  return it == image.channels.end() ? nullptr : &*it;
}

Result<ImageF> rgb_of(const ExrImage& exr, const std::string& path) {
  const ExrChannel* channels[3] = {find_channel(exr, "R"), find_channel(exr, "G"), find_channel(exr, "B")};
  if (const ExrChannel* y = find_channel(exr, "Y"); y != nullptr && channels[0] == nullptr) {
    std::fill(std::begin(channels), std::end(channels), y);
  }
  for (const ExrChannel* channel : channels) {
    if (channel == nullptr) {
      return Error{ErrorCode::kInput, fmt::format("{}: channels: expected R, G and B, or Y, found others", path)};
    }
  }
  ImageF image{exr.width, exr.height, std::vector<float>(uint64_t{3} * exr.width * exr.height)};
  for (size_t c = 0; c < 3; ++c) {
    const std::vector<float>& values = channels[c]->values;
    for (size_t i = 0; i < values.size(); ++i) image.rgb[3 * i + c] = values[i];
  }
  return image;
}

}  // namespace

Result<Image8> decode_image(std::span<const std::byte> bytes, const std::string& name, uint64_t max_pixels) {
  if (is_png(bytes)) return decode_png(bytes, name, max_pixels);
  if (is_jpeg(bytes)) return decode_jpeg(bytes, name, max_pixels);
  return Error{ErrorCode::kInput, fmt::format("{}: expected a PNG or a JPEG, found another format", name)};
}

Result<ImageF> read_hdr_image(FileSystem& fs, const std::string& path, uint64_t max_pixels) {
  SHOAL_ASSIGN_OR_RETURN(auto file, fs.open(path, ReadMode::kBuffered));
  if (is_exr(*file)) {
    SHOAL_ASSIGN_OR_RETURN(const ExrImage exr, read_exr(fs, path, max_pixels));
    return rgb_of(exr, path);
  }
  file.reset();
  const uint64_t limit_bytes = kMaxHeaderBytes + std::min(max_pixels, uint64_t{1} << 40) * 8;
  SHOAL_ASSIGN_OR_RETURN(const std::string text, read_whole_file(fs, path, limit_bytes));
  const auto bytes = std::as_bytes(std::span(text));
  if (is_radiance(bytes)) return decode_radiance(bytes, path, max_pixels);
  return Error{ErrorCode::kInput, fmt::format("{}: expected a Radiance .hdr or an OpenEXR, found neither", path)};
}

}  // namespace shoal
