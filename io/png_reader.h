// What every reader of PNG starts with: libpng's state, its errors as a message, and the limits under which strangers' files
// are read. Included by io/png_image.cpp and io/png_thumbnail.cpp only. One thread a reader.
//
// libpng reports errors by longjmp. Functions that call setjmp, and those that libpng calls, hold plain data only, so that no
// destructor is skipped.
#pragma once

#include <png.h>

#include <csetjmp>
#include <cstdio>

namespace shoal {

struct PngMessage {
  char text[160] = "libpng cannot start";
};

inline void on_png_error(png_structp png, png_const_charp text) {
  std::snprintf(static_cast<PngMessage*>(png_get_error_ptr(png))->text, sizeof PngMessage::text, "%s", text);
  png_longjmp(png, 1);
}

inline void on_png_warning(png_structp, png_const_charp) {}

/// Owns libpng's reading state, and where bytes come from.
template <class Source>
struct PngReader {
  explicit PngReader(Source from = {}) : source(from) {
    png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &message, on_png_error, on_png_warning);
    if (png != nullptr) info = png_create_info_struct(png);
  }
  ~PngReader() { png_destroy_read_struct(&png, &info, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  PngMessage message;
  Source source;
  png_structp png = nullptr;
  png_infop info = nullptr;  ///< null: libpng could not start
};

/// Reads up to the pixels and asks for 8-bit RGB or RGBA, whatever the file holds; `on_read` is of libpng's kind. To be called
/// between setjmp and the first use of what it read.
template <class Source>
void begin_png(PngReader<Source>& reader, png_rw_ptr on_read) {
  constexpr png_uint_32 kMaxSide = 1u << 20;
  constexpr png_alloc_size_t kMaxChunkBytes = 8u << 20;  // of text, profiles and the like, which nobody reads
  constexpr png_uint_32 kMaxChunks = 256;
  png_set_read_fn(reader.png, &reader.source, on_read);
  png_set_user_limits(reader.png, kMaxSide, kMaxSide);
  png_set_chunk_malloc_max(reader.png, kMaxChunkBytes);
  png_set_chunk_cache_max(reader.png, kMaxChunks);
  png_read_info(reader.png, reader.info);
  png_set_expand(reader.png);
  png_set_strip_16(reader.png);
  png_set_gray_to_rgb(reader.png);
}

}  // namespace shoal
