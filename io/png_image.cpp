#include "io/png_image.h"

#include <fmt/format.h>

#include <cstring>

#include "io/png_reader.h"

// What functions that call setjmp fill is owned by their caller (io/png_reader.h).

namespace shoal {

namespace {

struct Source {
  const std::byte* next;
  size_t left;
};

void on_read(png_structp png, png_bytep out, size_t n) {
  auto* source = static_cast<Source*>(png_get_io_ptr(png));
  if (n > source->left) png_error(png, "the data ends too early");
  std::memcpy(out, source->next, n);
  source->next += n;
  source->left -= n;
}

using Reader = PngReader<Source>;

bool read_header(Reader& reader, bool& has_alpha) {
  if (setjmp(png_jmpbuf(reader.png)) != 0) return false;
  begin_png(reader, on_read);
  has_alpha = (png_get_color_type(reader.png, reader.info) & PNG_COLOR_MASK_ALPHA) != 0 ||
              png_get_valid(reader.png, reader.info, PNG_INFO_tRNS) != 0;
  png_set_add_alpha(reader.png, 0xff, PNG_FILLER_AFTER);
  return true;
}

/// Requires: read_header(), and width * height * 4 bytes at `rgba`.
bool read_pixels(Reader& reader, uint32_t width, uint32_t height, uint8_t* rgba) {
  if (setjmp(png_jmpbuf(reader.png)) != 0) return false;
  const int passes = png_set_interlace_handling(reader.png);
  png_read_update_info(reader.png, reader.info);
  if (png_get_rowbytes(reader.png, reader.info) != size_t{width} * 4) png_error(reader.png, "rows of another size");
  for (int pass = 0; pass < passes; ++pass) {
    for (uint32_t y = 0; y < height; ++y) png_read_row(reader.png, rgba + size_t{y} * width * 4, nullptr);
  }
  png_read_end(reader.png, nullptr);
  return true;
}

struct Writer {
  Writer() {
    png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &message, on_png_error, on_png_warning);
    if (png != nullptr) info = png_create_info_struct(png);
  }
  ~Writer() { png_destroy_write_struct(&png, &info); }
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  PngMessage message;
  std::vector<std::byte> bytes;
  png_structp png = nullptr;
  png_infop info = nullptr;
};

void on_write(png_structp png, png_bytep data, size_t n) {
  auto& bytes = static_cast<Writer*>(png_get_io_ptr(png))->bytes;
  const auto* begin = reinterpret_cast<const std::byte*>(data);
  bytes.insert(bytes.end(), begin, begin + n);
}

void on_flush(png_structp) {}

bool write_pixels(Writer& writer, uint32_t width, uint32_t height, const uint8_t* rgb) {
  if (setjmp(png_jmpbuf(writer.png)) != 0) return false;
  png_set_write_fn(writer.png, &writer, on_write, on_flush);
  png_set_IHDR(writer.png, writer.info, width, height, 8, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_set_sRGB(writer.png, writer.info, PNG_sRGB_INTENT_RELATIVE);
  png_write_info(writer.png, writer.info);
  for (uint32_t y = 0; y < height; ++y) png_write_row(writer.png, rgb + size_t{y} * width * 3);
  png_write_end(writer.png, writer.info);
  return true;
}

}  // namespace

bool is_png(std::span<const std::byte> bytes) {
  return bytes.size() >= 8 && png_sig_cmp(reinterpret_cast<png_const_bytep>(bytes.data()), 0, 8) == 0;
}

Result<Image8> decode_png(std::span<const std::byte> bytes, const std::string& name, uint64_t max_pixels) {
  Reader reader({bytes.data(), bytes.size()});
  if (reader.info == nullptr) return Error{ErrorCode::kInternal, name + ": libpng cannot start"};
  Image8 image;
  if (!read_header(reader, image.has_alpha)) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected a PNG, found: {}", name, reader.message.text)};
  }
  image.width = png_get_image_width(reader.png, reader.info);
  image.height = png_get_image_height(reader.png, reader.info);
  const uint64_t pixels = uint64_t{image.width} * image.height;
  if (pixels > max_pixels) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected at most {} pixels, found {} x {}", name, max_pixels,
                                                image.width, image.height)};
  }
  image.rgba.resize(pixels * 4);
  if (!read_pixels(reader, image.width, image.height, image.rgba.data())) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected a PNG, found: {}", name, reader.message.text)};
  }
  return image;
}

Result<std::vector<std::byte>> encode_png(uint32_t width, uint32_t height, std::span<const uint8_t> rgb) {
  SHOAL_CHECK(rgb.size() == uint64_t{3} * width * height);
  Writer writer;
  if (writer.info == nullptr || !write_pixels(writer, width, height, rgb.data())) {
    return Error{ErrorCode::kInternal, fmt::format("libpng: {}", writer.message.text)};
  }
  return std::move(writer.bytes);
}

Status write_png(FileSystem& fs, const std::string& path, uint32_t width, uint32_t height,
                 std::span<const uint8_t> rgb) {
  const Result<std::vector<std::byte>> png = encode_png(width, height, rgb);
  if (!png.ok()) return Error{png.error().code, path + ": " + png.error().message};
  return write_whole_file(fs, path, png.value());
}

}  // namespace shoal
