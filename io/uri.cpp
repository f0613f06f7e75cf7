#include "io/uri.h"

#include <algorithm>

#include "io/base64.h"

namespace shoal {

namespace {

Error bad(std::string message) { return Error{ErrorCode::kInput, std::move(message)}; }

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

bool has_scheme(std::string_view uri) {
  const size_t end = uri.find_first_of(":/");
  return end != std::string_view::npos && uri[end] == ':';
}

Result<std::string> percent_decode(std::string_view uri) {
  std::string path;
  path.reserve(uri.size());
  for (size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] != '%') {
      path += uri[i];
      continue;
    }
    const int high = i + 2 < uri.size() ? hex_digit(uri[i + 1]) : -1;
    const int low = high >= 0 ? hex_digit(uri[i + 2]) : -1;
    if (low < 0) return bad("two hexadecimal digits after every % of a URI");
    path += static_cast<char>(high * 16 + low);
    i += 2;
  }
  return path;
}

}  // namespace

bool is_data_uri(std::string_view uri) { return uri.starts_with("data:"); }

Result<std::vector<std::byte>> decode_data_uri(std::string_view uri) {
  const size_t comma = uri.find(',');
  if (comma == std::string_view::npos || !uri.substr(0, comma).ends_with(";base64")) {
    return bad("a data: URI with ;base64");
  }
  auto bytes = decode_base64(uri.substr(comma + 1));
  if (!bytes) return bad("base64 in a data: URI");
  return std::move(*bytes);
}

Result<std::string> resolve_uri(std::string_view folder, std::string_view uri) {
  if (has_scheme(uri)) return bad("a relative path or a data: URI; other schemes are not read");
  SHOAL_ASSIGN_OR_RETURN(const std::string path, percent_decode(uri));
  if (path.empty()) return bad("a path");
  if (path.find('\0') != std::string::npos) return bad("a path without NUL");
  if (path.front() == '/') return bad("a path inside the scene's folder");
  for (size_t begin = 0; begin <= path.size();) {
    const size_t end = std::min(path.find('/', begin), path.size());
    if (std::string_view(path).substr(begin, end - begin) == "..") {
      return bad("a path inside the scene's folder");
    }
    begin = end + 1;
  }
  if (folder.empty()) return path;
  std::string joined(folder);
  if (joined.back() != '/') joined += '/';
  return joined + path;
}

}  // namespace shoal
