#include "io/png_writer.h"

#include <algorithm>
#include <array>
#include <vector>

namespace shoal {
namespace {

using Bytes = std::vector<uint8_t>;

/// CRC-32 of PNG (W3C PNG third edition, annex D).
uint32_t crc32(std::span<const uint8_t> bytes) {
  static const std::array<uint32_t, 256> table = [] {
    std::array<uint32_t, 256> entries{};
    for (uint32_t n = 0; n < 256; ++n) {
      uint32_t c = n;
      for (int k = 0; k < 8; ++k) c = (c & 1) ? 0xedb88320u ^ (c >> 1) : c >> 1;
      entries[n] = c;
    }
    return entries;
  }();
  uint32_t crc = 0xffffffffu;
  for (const uint8_t byte : bytes) crc = table[(crc ^ byte) & 0xff] ^ (crc >> 8);
  return ~crc;
}

/// RFC 1950.
uint32_t adler32(std::span<const uint8_t> bytes) {
  uint32_t a = 1, b = 0;
  for (const uint8_t byte : bytes) {
    a = (a + byte) % 65521;
    b = (b + a) % 65521;
  }
  return b << 16 | a;
}

void append_big_endian(Bytes& out, uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<uint8_t>(value >> shift));
}

void append_chunk(Bytes& out, const char (&type)[5], std::span<const uint8_t> data) {
  append_big_endian(out, static_cast<uint32_t>(data.size()));
  const size_t start = out.size();
  out.insert(out.end(), type, type + 4);
  out.insert(out.end(), data.begin(), data.end());
  append_big_endian(out, crc32(std::span(out).subspan(start)));
}

/// RFC 1951 section 3.2.4: blocks of at most 65535 bytes as they are.
Bytes zlib_stored(std::span<const uint8_t> data) {
  Bytes out = {0x78, 0x01};
  for (size_t at = 0; at < data.size();) {
    const size_t size = std::min<size_t>(data.size() - at, 65535);
    out.push_back(at + size == data.size() ? 1 : 0);
    for (const uint32_t field : {static_cast<uint32_t>(size), ~static_cast<uint32_t>(size)}) {
      out.push_back(static_cast<uint8_t>(field)), out.push_back(static_cast<uint8_t>(field >> 8));
    }
    out.insert(out.end(), data.begin() + at, data.begin() + at + size);
    at += size;
  }
  append_big_endian(out, adler32(data));
  return out;
}

}  // namespace

Status write_png_rgba(FileSystem& fs, const std::string& path, uint32_t width, uint32_t height,
                      std::span<const uint8_t> rgba) {
  SHOAL_CHECK(width >= 1 && width <= 16384 && height >= 1 && height <= 16384);
  const size_t row_bytes = size_t{4} * width;
  SHOAL_CHECK(rgba.size() == row_bytes * height);
  Bytes rows;
  rows.reserve((row_bytes + 1) * height);
  for (uint32_t y = 0; y < height; ++y) {
    rows.push_back(0);  // filter: none
    rows.insert(rows.end(), rgba.begin() + y * row_bytes, rgba.begin() + (y + 1) * row_bytes);
  }
  Bytes header;
  append_big_endian(header, width);
  append_big_endian(header, height);
  header.insert(header.end(), {8, 6, 0, 0, 0});  // 8 bits, RGBA, deflate, adaptive filters, not interlaced
  Bytes png = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  append_chunk(png, "IHDR", header);
  append_chunk(png, "IDAT", zlib_stored(rows));
  append_chunk(png, "IEND", {});
  return write_whole_file(fs, path, std::as_bytes(std::span(png)));
}

}  // namespace shoal
