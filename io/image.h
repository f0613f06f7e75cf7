// Pictures in and out. Every decoder bounds sizes before it calls its library; libpng, libjpeg-turbo, libwebp
// and OpenEXR stay inside the one .cpp that adapts them. Thread rule: plain functions.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "io/file.h"
#include "io/result.h"

namespace shoal {

/// 8 bits a channel, RGBA, rows from the top, not converted (sRGB or linear is the caller's knowledge).
/// 16-bit PNGs keep their high byte.
struct Image8 {
  uint32_t width = 0, height = 0;
  bool has_alpha = false;
  std::vector<uint8_t> rgba;
};

/// PNG, JPEG or WebP by its first bytes. `name` is for messages. Fails with: kInput.
Result<Image8> decode_image(std::span<const std::byte> bytes, const std::string& name, uint64_t max_pixels);

/// Linear float RGB, rows from the top.
struct ImageF {
  uint32_t width = 0, height = 0;
  std::vector<float> rgb;
};

/// Radiance .hdr (RGBE, flat and run-length) or OpenEXR, by content. Fails with: kInput.
Result<ImageF> read_hdr_image(FileSystem& fs, const std::string& path, uint64_t max_pixels);
/// What read_hdr_image() will take, from the header: `kept_bytes` of the result, and `peak_bytes` at most while it reads.
struct HdrImageSize {
  uint32_t width = 0, height = 0;
  uint64_t kept_bytes = 0, peak_bytes = 0;
};
/// Fails with: kInput.
Result<HdrImageSize> hdr_image_size(FileSystem& fs, const std::string& path, uint64_t max_pixels);

/// A named channel of an EXR: `R`, `albedo.R`, `normal.X`, `Z`, `sampleCount.Y`.
struct ExrChannel {
  std::string name;
  bool half = false;           ///< stored as half, else float
  std::vector<float> values;   ///< width * height, rows from the top
  std::vector<uint32_t> integers = {};  ///< likewise: stored as UINT. Written without `values`, read beside them
};
struct ExrImage {
  uint32_t width = 0, height = 0;                 ///< of the data window
  int32_t data_x = 0, data_y = 0;                 ///< data window's corner in the display window
  uint32_t display_width = 0, display_height = 0; ///< 0: as the data window
  std::vector<ExrChannel> channels;
  std::map<std::string, std::string> text;        ///< string attributes: software, ...
  std::map<std::string, float> numbers;           ///< float attributes: renderTimeSeconds, samplesPerPixel
  std::map<std::string, std::array<float, 16>> matrices;  ///< worldToCamera, worldToNDC (row vectors, as Imath)
};
/// One part, ZIP, atomically. Fails with: kStorage.
Status write_exr(FileSystem& fs, const std::string& path, const ExrImage& image);
/// R, G and B alone, or Y three times, straight into their place. Fails with: kInput.
Result<ImageF> read_exr_rgb(FileSystem& fs, const std::string& path, uint64_t max_pixels);
/// Fails with: kInput.
Result<ExrImage> read_exr(FileSystem& fs, const std::string& path, uint64_t max_pixels);

/// 8-bit sRGB-encoded RGB, atomically. Fails with: kStorage.
Status write_png(FileSystem& fs, const std::string& path, uint32_t width, uint32_t height,
                 std::span<const uint8_t> rgb);

}  // namespace shoal
