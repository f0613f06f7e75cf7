#include "io/radiance_image.h"

#include <fmt/format.h>

#include <charconv>
#include <string_view>

namespace shoal {

namespace {

constexpr size_t kMaxLineBytes = 4096;
constexpr uint32_t kMaxSide = 1u << 20;

using Rgbe = std::array<uint8_t, 4>;

/// The bytes not yet read; nothing is read past their end.
class Bytes {
 public:
  explicit Bytes(std::span<const std::byte> bytes) : left_(bytes) {}
  bool take(uint8_t& out) {
    if (left_.empty()) return false;
    out = static_cast<uint8_t>(left_[0]);
    left_ = left_.subspan(1);
    return true;
  }
  bool take(Rgbe& out) { return take(out[0]) && take(out[1]) && take(out[2]) && take(out[3]); }
  bool take_line(std::string& line) {
    line.clear();
    for (uint8_t c = 0; take(c) && line.size() < kMaxLineBytes;) {
      if (c == '\n') return true;
      line += static_cast<char>(c);
    }
    return false;
  }

 private:
  std::span<const std::byte> left_;
};

/// "-Y height +X width", rows from the top: the only order that tools write.
bool parse_size(std::string_view line, uint32_t& width, uint32_t& height) {
  if (!line.starts_with("-Y ")) return false;
  line.remove_prefix(3);
  const auto y = std::from_chars(line.data(), line.data() + line.size(), height);
  line.remove_prefix(static_cast<size_t>(y.ptr - line.data()));
  if (y.ec != std::errc() || !line.starts_with(" +X ")) return false;
  line.remove_prefix(4);
  const auto x = std::from_chars(line.data(), line.data() + line.size(), width);
  return x.ec == std::errc() && x.ptr == line.data() + line.size() && width > 0 && height > 0 &&
         width <= kMaxSide && height <= kMaxSide;
}

/// One component at a time: a count above 128 repeats the next byte, others copy. False: runs that do not fit.
bool read_new_runs(Bytes& bytes, std::span<Rgbe> row) {
  for (size_t component = 0; component < 4; ++component) {
    for (size_t x = 0; x < row.size();) {
      uint8_t count = 0, value = 0;
      if (!bytes.take(count)) return false;
      const bool repeat = count > 128;
      const size_t n = repeat ? count - 128u : count;
      if (n == 0 || n > row.size() - x) return false;
      if (repeat && !bytes.take(value)) return false;
      for (size_t i = 0; i < n; ++i) {
        if (!repeat && !bytes.take(value)) return false;
        row[x++][component] = value;
      }
    }
  }
  return true;
}

/// Pixels as they are; (1, 1, 1, n) repeats the one before n times, further ones count in higher bytes.
bool read_old_runs(Bytes& bytes, Rgbe pixel, std::span<Rgbe> row) {
  unsigned shift = 0;
  for (size_t x = 0;;) {
    if (pixel[0] == 1 && pixel[1] == 1 && pixel[2] == 1) {
      const uint64_t n = shift < 32 ? uint64_t{pixel[3]} << shift : 0;
      if (x == 0 || n > row.size() - x || shift >= 32) return false;
      for (uint64_t i = 0; i < n; ++i, ++x) row[x] = row[x - 1];
      shift += 8;
    } else {
      row[x++] = pixel;
      shift = 0;
    }
    if (x == row.size()) return true;
    if (!bytes.take(pixel)) return false;
  }
}

bool read_row(Bytes& bytes, std::span<Rgbe> row) {
  Rgbe start;
  if (!bytes.take(start)) return false;
  const bool new_runs = row.size() >= 8 && row.size() < 0x8000 && start[0] == 2 && start[1] == 2 && start[2] < 128;
  if (!new_runs) return read_old_runs(bytes, start, row);
  return start[2] * 256u + start[3] == row.size() && read_new_runs(bytes, row);
}

/// 2^(e - 128 - 8) by its bits: exact, and the same everywhere.
float scale_of(uint8_t exponent) {
  if (exponent == 0) return 0.0f;
  float scale = 1.0f;
  const int power = exponent - 136;
  for (int i = 0; i < power; ++i) scale *= 2.0f;
  for (int i = 0; i > power; --i) scale *= 0.5f;
  return scale;
}

Error wrong(const std::string& name, std::string_view expected, std::string_view found) {
  return {ErrorCode::kInput, fmt::format("{}: expected {}, found {}", name, expected, found)};
}

Result<ImageF> read_header(Bytes& bytes, const std::string& name, uint64_t max_pixels) {
  const auto bad = [&](std::string_view expected, std::string_view found) { return wrong(name, expected, found); };
  std::string line;
  if (!bytes.take_line(line)) return bad("a Radiance header", "its end");
  do {
    if (!bytes.take_line(line)) return bad("a Radiance header with an empty line at its end", "none");
    if (line.starts_with("FORMAT=") && line != "FORMAT=32-bit_rle_rgbe") {
      return bad("FORMAT=32-bit_rle_rgbe", "another format");
    }
  } while (!line.empty());
  ImageF image;
  if (!bytes.take_line(line) || !parse_size(line, image.width, image.height)) {
    return bad("a size such as -Y 512 +X 1024", "none");
  }
  const uint64_t pixels = uint64_t{image.width} * image.height;
  if (pixels > max_pixels) {
    return bad(fmt::format("at most {} pixels", max_pixels), fmt::format("{} x {}", image.width, image.height));
  }
  return image;
}

}  // namespace

bool is_radiance(std::span<const std::byte> bytes) {
  return bytes.size() >= 2 && bytes[0] == std::byte{'#'} && bytes[1] == std::byte{'?'};
}

Result<ImageF> decode_radiance_header(std::span<const std::byte> data, const std::string& name, uint64_t max_pixels) {
  Bytes bytes(data);
  if (!is_radiance(data)) return wrong(name, "a Radiance .hdr or an OpenEXR", "neither");
  return read_header(bytes, name, max_pixels);
}

Result<ImageF> decode_radiance(std::span<const std::byte> data, const std::string& name, uint64_t max_pixels) {
  Bytes bytes(data);
  SHOAL_ASSIGN_OR_RETURN(ImageF image, read_header(bytes, name, max_pixels));
  // Address space alone: memory comes with the rows, so a header cannot ask for it on its own.
  image.rgb.reserve(uint64_t{3} * image.width * image.height);
  std::array<float, 256> scales;
  for (unsigned e = 0; e < 256; ++e) scales[e] = scale_of(static_cast<uint8_t>(e));
  std::vector<Rgbe> row(image.width);
  for (uint32_t y = 0; y < image.height; ++y) {
    if (!read_row(bytes, row)) return wrong(name, "whole rows of pixels", fmt::format("row {} broken or cut off", y));
    for (const Rgbe& pixel : row) {
      for (size_t c = 0; c < 3; ++c) image.rgb.push_back(static_cast<float>(pixel[c]) * scales[pixel[3]]);
    }
  }
  return image;
}

}  // namespace shoal
