#include "io/png_thumbnail.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "io/png_reader.h"

namespace shoal {
namespace {

/// The file, a block at a time.
struct Source {
  ReadableFile* file = nullptr;
  uint64_t offset = 0;
  size_t at = 0, filled = 0;
  std::array<std::byte, 64u << 10> block;

  bool failed = false;  ///< the storage, not the PNG
  bool refill() {
    filled = static_cast<size_t>(std::min<uint64_t>(block.size(), file->size_bytes() - offset));
    at = 0;
    if (filled == 0) return false;
    failed = !file->read_at(offset, std::span(block).first(filled)).ok();
    offset += filled;
    return !failed;
  }
};

void on_read(png_structp png, png_bytep out, size_t n) {
  auto* source = static_cast<Source*>(png_get_io_ptr(png));
  while (n > 0) {
    if (source->at == source->filled && !source->refill()) png_error(png, "the data ends too early");
    const size_t part = std::min(n, source->filled - source->at);
    std::memcpy(out, source->block.data() + source->at, part);
    source->at += part, out += part, n -= part;
  }
}

bool read_header(PngReader<Source>& reader) {
  if (setjmp(png_jmpbuf(reader.png)) != 0) return false;
  begin_png(reader, on_read);
  if (png_get_interlace_type(reader.png, reader.info) != PNG_INTERLACE_NONE) png_error(reader.png, "rows out of order");
  png_set_strip_alpha(reader.png);
  png_read_update_info(reader.png, reader.info);
  if (png_get_rowbytes(reader.png, reader.info) != size_t{3} * png_get_image_width(reader.png, reader.info)) {
    png_error(reader.png, "rows of another size");
  }
  return true;
}

bool read_row(PngReader<Source>& reader, uint8_t* row) {
  if (setjmp(png_jmpbuf(reader.png)) != 0) return false;
  png_read_row(reader.png, row, nullptr);
  return true;
}

}  // namespace

Result<Thumbnail> shrink_png(FileSystem& fs, const std::string& path, uint32_t max_side) {
  SHOAL_CHECK(max_side > 0);
  SHOAL_ASSIGN_OR_RETURN(const auto file, fs.open(path, ReadMode::kBuffered));
  const auto reader = std::make_unique<PngReader<Source>>();
  reader->source.file = file.get();
  const auto refused = [&] {
    if (reader->source.failed) return Error{ErrorCode::kStorage, path + ": cannot be read"};
    return Error{ErrorCode::kInput, fmt::format("{}: expected a PNG, found: {}", path, reader->message.text)};
  };
  if (reader->info == nullptr || !read_header(*reader)) return refused();
  const uint64_t width = png_get_image_width(reader->png, reader->info);
  const uint64_t height = png_get_image_height(reader->png, reader->info);
  const uint64_t longest = std::max<uint64_t>({width, height, max_side});
  Thumbnail small;
  small.width = static_cast<uint32_t>(std::max<uint64_t>(width * max_side / longest, 1));
  small.height = static_cast<uint32_t>(std::max<uint64_t>(height * max_side / longest, 1));
  std::vector<uint64_t> sums(size_t{3} * small.width * small.height), counts(size_t{1} * small.width * small.height);
  std::vector<uint8_t> row(3 * width);
  for (uint64_t y = 0; y < height; ++y) {
    if (!read_row(*reader, row.data())) return refused();
    const uint64_t line = y * small.height / height * small.width;
    for (uint64_t x = 0; x < width; ++x) {
      const uint64_t pixel = line + x * small.width / width;
      ++counts[pixel];
      for (uint64_t c = 0; c < 3; ++c) sums[pixel * 3 + c] += row[x * 3 + c];
    }
  }
  small.rgb.resize(sums.size());
  for (size_t i = 0; i < sums.size(); ++i) small.rgb[i] = static_cast<uint8_t>(sums[i] / std::max<uint64_t>(counts[i / 3], 1));
  return small;
}

}  // namespace shoal
