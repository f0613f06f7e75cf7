#include "io/exr_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

// Layout: magic, version, then attributes (name NUL, type NUL, int32 size, value) up to an empty name
// (OpenEXR, "The OpenEXR File Layout").

namespace shoal {

namespace {

constexpr uint32_t kMagic = 20000630;
constexpr uint32_t kVersionMask = 0xff;
constexpr uint32_t kLongNames = 0x400;           // the only flag that one part of scan lines may carry
constexpr uint64_t kMaxHeaderBytes = 16u << 20;  // previews may be large; nothing else is
constexpr size_t kMaxNameBytes = 255;
constexpr int64_t kMaxCoordinate = 1 << 28;
constexpr int64_t kMaxSide = 1 << 20;
// NONE, RLE, ZIPS, ZIP, PIZ, PXR24. B44 and DWA are lossy, rare in environment maps, and their decoders the
// least tested against hostile bytes.
constexpr uint8_t kLastCompression = 5;

struct Box {
  int64_t min_x, min_y, max_x, max_y;
};

/// Reads on through a header held in memory.
class HeaderBytes {
 public:
  explicit HeaderBytes(std::span<const std::byte> bytes) : left_(bytes) {}

  template <class T>
  bool take(T& out) {
    if (left_.size() < sizeof out) return false;
    std::memcpy(&out, left_.data(), sizeof out);
    left_ = left_.subspan(sizeof out);
    return true;
  }
  bool take_name(std::string& name) {
    const size_t limit = std::min(left_.size(), kMaxNameBytes + 1);
    const auto end = std::find(left_.begin(), left_.begin() + static_cast<std::ptrdiff_t>(limit), std::byte{0});
    const auto size = static_cast<size_t>(end - left_.begin());
    if (size == limit) return false;
    name.assign(reinterpret_cast<const char*>(left_.data()), size);
    left_ = left_.subspan(size + 1);
    return true;
  }
  bool empty() const { return left_.empty(); }
  uint64_t size() const { return left_.size(); }
  std::optional<HeaderBytes> take_value(uint64_t size) {
    if (size > left_.size()) return std::nullopt;
    HeaderBytes value(left_.first(size));
    left_ = left_.subspan(size);
    return value;
  }

 private:
  std::span<const std::byte> left_;
};

/// Bytes of a value whose type has one length. The library reads so many whatever the attribute's size says: an
/// attribute that says otherwise would be read as another header than the one that is checked here.
std::optional<uint64_t> fixed_bytes(const std::string& type) {
  static const std::map<std::string, uint64_t> kBytes = {{"box2f", 16},
                                                         {"box2i", 16},
                                                         {"chromaticities", 32},
                                                         {"compression", 1},
                                                         {"deepImageState", 1},
                                                         {"double", 8},
                                                         {"envmap", 1},
                                                         {"float", 4},
                                                         {"int", 4},
                                                         {"keycode", 28},
                                                         {"lineOrder", 1},
                                                         {"m33d", 72},
                                                         {"m33f", 36},
                                                         {"m44d", 128},
                                                         {"m44f", 64},
                                                         {"rational", 8},
                                                         {"tiledesc", 9},
                                                         {"timecode", 8},
                                                         {"v2d", 16},
                                                         {"v2f", 8},
                                                         {"v2i", 8},
                                                         {"v3d", 24},
                                                         {"v3f", 12},
                                                         {"v3i", 12}};
  const auto found = kBytes.find(type);
  return found == kBytes.end() ? std::nullopt : std::optional(found->second);
}

struct Seen {
  std::set<std::string> names;
  std::optional<Box> data_window, display_window;
  std::optional<uint64_t> channel_count;
  std::optional<uint8_t> compression;
};

std::optional<Box> read_box(HeaderBytes value) {
  int32_t v[4];
  for (int32_t& x : v) {
    if (!value.take(x) || x < -kMaxCoordinate || x > kMaxCoordinate) return std::nullopt;
  }
  const Box box{v[0], v[1], v[2], v[3]};
  if (box.min_x > box.max_x || box.min_y > box.max_y) return std::nullopt;
  if (box.max_x - box.min_x >= kMaxSide || box.max_y - box.min_y >= kMaxSide) return std::nullopt;
  return box;
}

/// Name NUL, int32 type, uint8 linear, 3 reserved, int32 x and y sampling; an empty name ends the list.
std::optional<uint64_t> count_channels(HeaderBytes value) {
  std::string name;
  for (uint64_t count = 0; count <= kMaxExrChannels; ++count) {
    if (!value.take_name(name)) return std::nullopt;
    if (name.empty()) return count > 0 && value.empty() ? std::optional(count) : std::nullopt;
    int32_t type, x_sampling, y_sampling;
    uint32_t linear;
    if (!value.take(type) || !value.take(linear) || !value.take(x_sampling) || !value.take(y_sampling)) {
      return std::nullopt;
    }
    if (type < 0 || type > 2 || x_sampling != 1 || y_sampling != 1) return std::nullopt;
  }
  return std::nullopt;
}

/// Strings, each behind its length.
bool is_string_vector(HeaderBytes value) {
  while (!value.empty()) {
    int32_t size = -1;
    if (!value.take(size) || size < 0 || !value.take_value(static_cast<uint64_t>(size))) return false;
  }
  return true;
}

/// Width, height and RGBA.
bool is_preview(HeaderBytes value) {
  uint32_t width = 0, height = 0;
  if (!value.take(width) || !value.take(height) || width > kMaxHeaderBytes || height > kMaxHeaderBytes)
    return false;
  return uint64_t{4} * width * height == value.size();
}

/// Whether the library, which believes the type, reads the bytes that the attribute's size says. Unknown types are
/// bytes.
bool fits_its_type(const std::string& type, HeaderBytes value) {
  if (const auto bytes = fixed_bytes(type)) return value.size() == *bytes;
  if (type == "stringvector") return is_string_vector(value);
  if (type == "preview") return is_preview(value);
  if (type == "floatvector") return value.size() % sizeof(float) == 0;
  if (type == "chlist") return count_channels(value).has_value();
  return type != "idmanifest";  // compressed tables, of no use to a picture
}

/// What is wrong with an attribute, or nothing.
std::string look_at(const std::string& name, const std::string& type, HeaderBytes value, Seen& seen) {
  if (!seen.names.insert(name).second) return "expected an attribute once, found it twice";
  if (!fits_its_type(type, value) && name != "channels")
    return fmt::format("{} bytes are no value of type {}", value.size(), type);
  if (name == "dataWindow" || name == "displayWindow") {
    const auto box = type == "box2i" ? read_box(value) : std::nullopt;
    if (!box) return "expected a window of at most 2^20 pixels a side, found another";
    (name == "dataWindow" ? seen.data_window : seen.display_window) = box;
  } else if (name == "channels") {
    seen.channel_count = type == "chlist" ? count_channels(value) : std::nullopt;
    if (!seen.channel_count) return "expected 1 to 256 channels without subsampling, found others";
  } else if (name == "compression") {
    uint8_t compression = 0;
    if (type != "compression" || !value.take(compression) || compression > kLastCompression) {
      return "expected NONE, RLE, ZIPS, ZIP, PIZ or PXR24, found another (convert it, for example to ZIP)";
    }
    seen.compression = compression;
  }
  return {};
}

Result<ExrSize> check_sizes(const std::string& path, const Seen& seen, uint64_t max_pixels) {
  if (!seen.data_window || !seen.display_window || !seen.channel_count || !seen.compression) {
    return Error{ErrorCode::kInput, fmt::format("{}: EXR header: expected dataWindow, displayWindow, channels and "
                                                "compression, found not all of them",
                                                path)};
  }
  const Box& box = *seen.data_window;
  const auto width = static_cast<uint64_t>(box.max_x - box.min_x + 1);
  const auto height = static_cast<uint64_t>(box.max_y - box.min_y + 1);
  const uint64_t pixels = width * height;  // at most 2^40
  if (pixels > max_pixels || pixels * *seen.channel_count / 4 > max_pixels) {
    return Error{ErrorCode::kInput,
                 fmt::format("{}: dataWindow: expected at most {} pixels of 4 values, found {} x "
                             "{} of {} channels",
                             path, max_pixels, width, height, *seen.channel_count)};
  }
  return ExrSize{static_cast<uint32_t>(width), static_cast<uint32_t>(height),
                 static_cast<uint32_t>(*seen.channel_count)};
}

}  // namespace

bool is_exr(ReadableFile& file) {
  uint32_t magic = 0;
  return file.size_bytes() >= sizeof magic && file.read_at(0, std::as_writable_bytes(std::span(&magic, 1))).ok() &&
         magic == kMagic;
}

Result<ExrSize> check_exr_header(ReadableFile& file, uint64_t max_pixels) {
  const auto bad = [&](const std::string& message) {
    return Error{ErrorCode::kInput, fmt::format("{}: EXR header: {}", file.path(), message)};
  };
  std::vector<std::byte> bytes(std::min(file.size_bytes(), kMaxHeaderBytes));
  SHOAL_RETURN_IF_ERROR(file.read_at(0, bytes));
  HeaderBytes header(bytes);
  uint32_t magic = 0, version = 0;
  if (!header.take(magic) || !header.take(version) || magic != kMagic)
    return bad("expected an OpenEXR, found none");
  if ((version & kVersionMask) != 2 || (version & ~(kVersionMask | kLongNames)) != 0) {
    return bad("expected version 2, one part of scan lines, found tiles, deep data or several parts");
  }
  Seen seen;
  for (std::string name, type;;) {
    if (!header.take_name(name)) return bad("expected attributes up to an empty name, found none");
    if (name.empty()) break;
    int32_t size = -1;
    if (!header.take_name(type) || !header.take(size) || size < 0) return bad("expected an attribute, found none");
    const auto value = header.take_value(static_cast<uint64_t>(size));
    if (!value) return bad(fmt::format("expected an attribute inside the header, found {} bytes", size));
    const std::string wrong = look_at(name, type, *value, seen);
    if (!wrong.empty()) return bad(fmt::format("{}: {}", name, wrong));
  }
  return check_sizes(file.path(), seen, max_pixels);
}

}  // namespace shoal
