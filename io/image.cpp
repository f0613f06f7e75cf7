#include "io/image.h"

#include <fmt/format.h>

#include <algorithm>

#include "io/exr_header.h"
#include "io/jpeg_image.h"
#include "io/png_image.h"
#include "io/radiance_image.h"
#include "io/webp_image.h"

namespace shoal {

namespace {

/// An .hdr cannot be larger than its pixels and a header, whatever its run lengths.
constexpr uint64_t kMaxHeaderBytes = 1u << 20;

/// What OpenEXR holds of a file while it reads: blocks of at most 32 lines, stored and decoded, of 4 bytes a value.
constexpr uint64_t kExrBlockLines = 32, kExrBlockCopies = 4;

}  // namespace

Result<Image8> decode_image(std::span<const std::byte> bytes, const std::string& name, uint64_t max_pixels) {
  if (is_png(bytes)) return decode_png(bytes, name, max_pixels);
  if (is_jpeg(bytes)) return decode_jpeg(bytes, name, max_pixels);
  if (is_webp(bytes)) return decode_webp(bytes, name, max_pixels);
  return Error{ErrorCode::kInput, fmt::format("{}: expected a PNG, a JPEG or a WebP, found another format", name)};
}

Result<ImageF> read_hdr_image(FileSystem& fs, const std::string& path, uint64_t max_pixels) {
  SHOAL_ASSIGN_OR_RETURN(auto file, fs.open(path, ReadMode::kBuffered));
  if (is_exr(*file)) {
    file.reset();
    return read_exr_rgb(fs, path, max_pixels);
  }
  file.reset();
  const uint64_t limit_bytes = kMaxHeaderBytes + std::min(max_pixels, uint64_t{1} << 40) * 8;
  SHOAL_ASSIGN_OR_RETURN(const std::string text, read_whole_file(fs, path, limit_bytes));
  const auto bytes = std::as_bytes(std::span(text));
  if (is_radiance(bytes)) return decode_radiance(bytes, path, max_pixels);
  return Error{ErrorCode::kInput, fmt::format("{}: expected a Radiance .hdr or an OpenEXR, found neither", path)};
}

Result<HdrImageSize> hdr_image_size(FileSystem& fs, const std::string& path, uint64_t max_pixels) {
  SHOAL_ASSIGN_OR_RETURN(const auto file, fs.open(path, ReadMode::kBuffered));
  HdrImageSize size;
  uint64_t beside = 0;
  if (is_exr(*file)) {
    SHOAL_ASSIGN_OR_RETURN(const ExrSize exr, check_exr_header(*file, max_pixels));
    size.width = exr.width, size.height = exr.height;
    beside = uint64_t{exr.width} * exr.channel_count * 4 * kExrBlockLines * kExrBlockCopies + kMaxHeaderBytes;
  } else {
    std::string start(std::min(file->size_bytes(), kMaxHeaderBytes), '\0');
    SHOAL_RETURN_IF_ERROR(file->read_at(0, std::as_writable_bytes(std::span(start))));
    SHOAL_ASSIGN_OR_RETURN(const ImageF empty, decode_radiance_header(std::as_bytes(std::span(start)), path, max_pixels));
    size.width = empty.width, size.height = empty.height;
    beside = file->size_bytes();  // the whole file, while it is decoded
  }
  size.kept_bytes = uint64_t{size.width} * size.height * 3 * sizeof(float);
  size.peak_bytes = size.kept_bytes + beside;
  return size;
}

}  // namespace shoal
