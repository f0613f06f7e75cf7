#include "io/jpeg_image.h"

#include <fmt/format.h>

#include <csetjmp>
#include <cstdio>
// jpeglib.h needs size_t and FILE before it.
#include <jerror.h>
#include <jpeglib.h>

// libjpeg reports errors by a handler that must not return. Every function below that calls setjmp holds plain data
// only, so that no destructor is skipped; what it fills is owned by its caller.

namespace shoal {

namespace {

/// A progressive file may repeat scans without end; real ones hold about ten.
constexpr int kMaxScans = 200;

/// Owns libjpeg's reading state.
struct Reader {
  Reader();
  ~Reader() { jpeg_destroy_decompress(&jpeg); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  jpeg_decompress_struct jpeg{};
  jpeg_error_mgr errors{};
  jpeg_progress_mgr progress{};
  std::jmp_buf jump;
  char message[JMSG_LENGTH_MAX] = "";
};

Reader& reader_of(j_common_ptr jpeg) { return *static_cast<Reader*>(jpeg->client_data); }

[[noreturn]] void on_error(j_common_ptr jpeg) {
  Reader& reader = reader_of(jpeg);
  jpeg->err->format_message(jpeg, reader.message);
  std::longjmp(reader.jump, 1);
}

/// libjpeg paints what is missing grey and warns; for us missing data is an error.
void on_message(j_common_ptr jpeg, int level) {
  const int code = jpeg->err->msg_code;
  if (level < 0 && (code == JWRN_JPEG_EOF || code == JWRN_HIT_MARKER)) on_error(jpeg);
}

void on_progress(j_common_ptr jpeg) {
  if (reinterpret_cast<j_decompress_ptr>(jpeg)->input_scan_number > kMaxScans) {
    Reader& reader = reader_of(jpeg);
    std::snprintf(reader.message, sizeof reader.message, "more than %d scans", kMaxScans);
    std::longjmp(reader.jump, 1);
  }
}

Reader::Reader() {
  jpeg.err = jpeg_std_error(&errors);
  errors.error_exit = on_error;
  errors.emit_message = on_message;
  progress.progress_monitor = on_progress;
  jpeg.client_data = this;  // kept by jpeg_create_decompress
}

bool read_header(Reader& reader, std::span<const std::byte> bytes) {
  if (setjmp(reader.jump) != 0) return false;
  jpeg_create_decompress(&reader.jpeg);
  reader.jpeg.progress = &reader.progress;
  jpeg_mem_src(&reader.jpeg, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  jpeg_read_header(&reader.jpeg, TRUE);
  return true;
}

/// Requires: read_header(), and width * height * 4 bytes at `rgba`.
bool read_pixels(Reader& reader, uint8_t* rgba) {
  if (setjmp(reader.jump) != 0) return false;
  reader.jpeg.out_color_space = JCS_EXT_RGBA;
  reader.jpeg.dct_method = JDCT_ISLOW;  // exact: the same bits on every processor
  jpeg_start_decompress(&reader.jpeg);
  const size_t row_bytes = size_t{reader.jpeg.output_width} * 4;
  while (reader.jpeg.output_scanline < reader.jpeg.output_height) {
    JSAMPROW row = rgba + reader.jpeg.output_scanline * row_bytes;
    jpeg_read_scanlines(&reader.jpeg, &row, 1);
  }
  jpeg_finish_decompress(&reader.jpeg);
  return true;
}

}  // namespace

bool is_jpeg(std::span<const std::byte> bytes) {
  return bytes.size() >= 3 && bytes[0] == std::byte{0xff} && bytes[1] == std::byte{0xd8} &&
         bytes[2] == std::byte{0xff};
}

Result<Image8> decode_jpeg(std::span<const std::byte> bytes, const std::string& name, uint64_t max_pixels) {
  Reader reader;
  if (!read_header(reader, bytes)) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected a JPEG, found: {}", name, reader.message)};
  }
  Image8 image;
  image.width = reader.jpeg.image_width;
  image.height = reader.jpeg.image_height;
  const uint64_t pixels = uint64_t{image.width} * image.height;
  if (pixels > max_pixels) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected at most {} pixels, found {} x {}", name, max_pixels,
                                                image.width, image.height)};
  }
  const J_COLOR_SPACE space = reader.jpeg.jpeg_color_space;
  if (space != JCS_GRAYSCALE && space != JCS_YCbCr && space != JCS_RGB) {
    return Error{ErrorCode::kInput,
                 fmt::format("{}: expected a grey, RGB or YCbCr JPEG, found another colour space "
                             "(CMYK?); convert it to RGB",
                             name)};
  }
  image.rgba.resize(pixels * 4);
  if (!read_pixels(reader, image.rgba.data())) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected a JPEG, found: {}", name, reader.message)};
  }
  return image;
}

}  // namespace shoal
