#include "engine/cache_levels.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <map>
#include <string_view>

namespace shoal {
namespace {

constexpr uint32_t kLineBytes = 64;
constexpr size_t kMostLevels = 4;
/// Where the machine does not say: an Ice Lake server's core, and its share of the last level.
constexpr const char* kAssumedLevels = "48K:12,2M:16,32M:16";

/// "48K"; nothing where it is no size.
bool parse_bytes(std::string_view text, uint64_t& bytes) {
  uint64_t unit = 1;
  if (!text.empty()) {
    const char last = text.back();
    if (last == 'K') unit = uint64_t{1} << 10;
    if (last == 'M') unit = uint64_t{1} << 20;
    if (last == 'G') unit = uint64_t{1} << 30;
    if (unit > 1) text.remove_suffix(1);
  }
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), bytes);
  if (error != std::errc() || end != text.data() + text.size() || bytes == 0 ||
      bytes > (uint64_t{1} << 40) / unit) {
    return false;
  }
  bytes *= unit;
  return true;
}

Error bad_levels(const std::string& text, const std::string& why) {
  return {ErrorCode::kUsage,
          fmt::format("--cache-levels '{}': {}; expected such as 48K:12,2M:16,105M:15", text, why)};
}

Result<CacheShape> parse_level(const std::string& text, std::string_view level) {
  const size_t colon = level.find(':');
  uint64_t bytes = 0, ways = 0;
  if (colon == std::string_view::npos || !parse_bytes(level.substr(0, colon), bytes) ||
      !parse_bytes(level.substr(colon + 1), ways) || ways > 1024) {
    return bad_levels(text, fmt::format("'{}' is not SIZE:WAYS", level));
  }
  const CacheShape shape{bytes, static_cast<uint32_t>(ways), kLineBytes};
  if (const Status status = shape.check(); !status.ok()) return bad_levels(text, status.error().message);
  return shape;
}

std::string size_text(uint64_t bytes) {
  if (bytes % (1u << 20) == 0) return fmt::format("{}M", bytes >> 20);
  if (bytes % (1u << 10) == 0) return fmt::format("{}K", bytes >> 10);
  return fmt::format("{}", bytes);
}

std::string first_word(const std::string& path) {
  std::ifstream file(path);
  std::string word;
  file >> word;
  return word;
}

/// One cache of the folder; false where it does not say, or holds no data.
bool read_level(const std::string& folder, uint64_t& level, CacheShape& shape) {
  uint64_t ways = 0, line = 0;
  if (first_word(folder + "/type") == "Instruction" || !parse_bytes(first_word(folder + "/level"), level) ||
      !parse_bytes(first_word(folder + "/size"), shape.bytes) ||
      !parse_bytes(first_word(folder + "/ways_of_associativity"), ways) ||
      !parse_bytes(first_word(folder + "/coherency_line_size"), line) || line != kLineBytes || ways > 1024) {
    return false;
  }
  shape.ways = static_cast<uint32_t>(ways);
  shape.line_bytes = kLineBytes;
  return shape.check().ok();
}

}  // namespace

Result<std::vector<CacheShape>> parse_cache_levels(const std::string& text) {
  std::vector<CacheShape> shapes;
  for (size_t first = 0; first <= text.size();) {
    const size_t last = std::min(text.find(',', first), text.size());
    SHOAL_ASSIGN_OR_RETURN(const CacheShape shape,
                           parse_level(text, std::string_view(text).substr(first, last - first)));
    shapes.push_back(shape);
    first = last + 1;
  }
  if (shapes.size() > kMostLevels) return bad_levels(text, fmt::format("more than {} levels", kMostLevels));
  return shapes;
}

std::string cache_levels_text(const std::vector<CacheShape>& shapes) {
  std::string text;
  for (const CacheShape& shape : shapes) {
    text += fmt::format("{}{}:{}", text.empty() ? "" : ",", size_text(shape.bytes), shape.ways);
  }
  return text;
}

CacheLevels machine_cache_levels(const std::string& folder) {
  std::map<uint64_t, CacheShape> by_level;
  for (int index = 0; index < 16; ++index) {
    uint64_t level = 0;
    CacheShape shape;
    if (read_level(fmt::format("{}/index{}", folder, index), level, shape)) by_level.emplace(level, shape);
  }
  CacheLevels levels;
  for (const auto& [level, shape] : by_level) levels.shapes.push_back(shape);
  if (!levels.shapes.empty() && by_level.begin()->first == 1 && levels.shapes.size() <= kMostLevels) {
    levels.source = "this machine's";
    return levels;
  }
  return {parse_cache_levels(kAssumedLevels).value(), "assumed: this machine does not say its own"};
}

std::string cache_level_name(size_t index, size_t count) {
  return count >= 3 && index + 1 == count ? "last level" : fmt::format("L{}", index + 1);
}

}  // namespace shoal
