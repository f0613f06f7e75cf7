#include "tests/io/image_samples.h"

#include <webp/encode.h>

#include <png.h>

#include <cstdio>
#include <cstdlib>
// clang-format off: jpeglib.h needs <cstdio> before it
#include <jpeglib.h>
// clang-format on

namespace shoal {

std::vector<std::byte> make_png(uint32_t width, uint32_t height, int color_type, int bit_depth, bool interlaced,
                                const std::vector<uint8_t>& bytes, const std::vector<uint8_t>& palette,
                                const std::vector<uint8_t>& transparent) {
  std::vector<std::byte> out;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_set_write_fn(
      png, &out,
      [](png_structp p, png_bytep data, size_t n) {
        auto& target = *static_cast<std::vector<std::byte>*>(png_get_io_ptr(p));
        target.insert(target.end(), reinterpret_cast<std::byte*>(data), reinterpret_cast<std::byte*>(data) + n);
      },
      [](png_structp) {});
  png_set_IHDR(png, info, width, height, bit_depth, color_type,
               interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  std::vector<png_color> colors;
  for (size_t i = 0; i + 2 < palette.size(); i += 3) colors.push_back({palette[i], palette[i + 1], palette[i + 2]});
  if (!colors.empty()) png_set_PLTE(png, info, colors.data(), static_cast<int>(colors.size()));
  png_color_16 zero{};
  if (!transparent.empty()) {
    const bool by_index = color_type == PNG_COLOR_TYPE_PALETTE;
    png_set_tRNS(png, info, by_index ? transparent.data() : nullptr,
                 by_index ? static_cast<int>(transparent.size()) : 1, &zero);
  }
  png_write_info(png, info);
  const size_t row_bytes = bytes.size() / height;
  std::vector<png_bytep> rows;
  for (uint32_t y = 0; y < height; ++y) rows.push_back(const_cast<png_bytep>(bytes.data() + y * row_bytes));
  png_write_image(png, rows.data());
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  return out;
}

std::vector<std::byte> make_jpeg(uint32_t width, uint32_t height, int components, bool progressive,
                                 const std::vector<uint8_t>& pixels) {
  jpeg_compress_struct jpeg{};
  jpeg_error_mgr errors{};
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_compress(&jpeg);
  unsigned char* memory = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&jpeg, &memory, &size);
  jpeg.image_width = width;
  jpeg.image_height = height;
  jpeg.input_components = components;
  jpeg.in_color_space = components == 1 ? JCS_GRAYSCALE : components == 3 ? JCS_RGB : JCS_CMYK;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, 98, TRUE);
  if (progressive) jpeg_simple_progression(&jpeg);
  jpeg_start_compress(&jpeg, TRUE);
  for (uint32_t y = 0; y < height; ++y) {
    auto* row = const_cast<JSAMPROW>(pixels.data() + size_t{y} * width * static_cast<size_t>(components));
    jpeg_write_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_compress(&jpeg);
  jpeg_destroy_compress(&jpeg);
  const auto* begin = reinterpret_cast<std::byte*>(memory);
  std::vector<std::byte> out(begin, begin + size);
  std::free(memory);
  return out;
}

std::vector<std::byte> make_webp(uint32_t width, uint32_t height, bool lossless, const std::vector<uint8_t>& rgba) {
  const int w = static_cast<int>(width), h = static_cast<int>(height);
  uint8_t* bytes = nullptr;
  const size_t size = lossless ? WebPEncodeLosslessRGBA(rgba.data(), w, h, 4 * w, &bytes)
                               : WebPEncodeRGBA(rgba.data(), w, h, 4 * w, 90, &bytes);
  std::vector<std::byte> out(size);
  for (size_t i = 0; i < size; ++i) out[i] = static_cast<std::byte>(bytes[i]);
  WebPFree(bytes);
  return out;
}

}  // namespace shoal
