#include "engine/named_files.h"

#include <algorithm>

namespace shoal {
namespace {

/// Nothing that is worth reading lies deeper; what does is counted only.
constexpr size_t kMaxDepth = 1u << 20;

void append_utf8(std::string& text, uint32_t code, size_t max_bytes) {
  if (text.size() > max_bytes) return;
  const auto put = [&](uint32_t byte) { text += static_cast<char>(byte); };
  if (code < 0x80) {
    put(code);
  } else if (code < 0x800) {
    put(0xc0 | code >> 6), put(0x80 | (code & 0x3f));
  } else if (code < 0x10000) {
    put(0xe0 | code >> 12), put(0x80 | (code >> 6 & 0x3f)), put(0x80 | (code & 0x3f));
  } else {
    put(0xf0 | code >> 18), put(0x80 | (code >> 12 & 0x3f)), put(0x80 | (code >> 6 & 0x3f)), put(0x80 | (code & 0x3f));
  }
}

uint32_t hex_value(char c) {
  if (c >= '0' && c <= '9') return static_cast<uint32_t>(c - '0');
  return static_cast<uint32_t>((c | 0x20) - 'a' + 10) & 15u;
}

}  // namespace

void NamedFiles::begin(bool object) {
  if (is_object_.size() < kMaxDepth) is_object_.push_back(object);
  is_key_ = object;
}

void NamedFiles::end() {
  if (!is_object_.empty()) is_object_.pop_back();
  is_key_ = false;
}

void NamedFiles::string_ended() {
  const size_t depth = is_object_.size();
  if (is_key_) {
    if (depth == 1) section_ = string_;
    if (depth == kFileDepth) key_ = string_;
    return;
  }
  const bool of_file = depth == kFileDepth && is_object_[0] && !is_object_[1] && is_object_[2] &&
                       (section_ == "buffers" || section_ == "images") && key_ == "uri";
  if (of_file && string_.size() <= kMaxUriBytes && !string_.starts_with("data:")) uris_.push_back(string_);
}

/// Behind a backslash.
void NamedFiles::escaped(char c) {
  escape_ = false;
  if (c == 'u') {
    hex_left_ = 4, code_ = 0;
    return;
  }
  static constexpr std::string_view kLetters = "bfnrt", kMeanings = "\b\f\n\r\t";
  const size_t at = kLetters.find(c);
  if (string_.size() <= kMaxUriBytes) string_ += at == std::string_view::npos ? c : kMeanings[at];
}

void NamedFiles::add(std::string_view text) {
  for (const char c : text) {
    if (!in_string_) {
      if (c == '"') in_string_ = true, string_.clear(), high_surrogate_ = 0;
      if (c == '{' || c == '[') begin(c == '{');
      if (c == '}' || c == ']') end();
      if (c == ',') is_key_ = !is_object_.empty() && is_object_.back();
      if (c == ':') is_key_ = false;
    } else if (hex_left_ > 0) {
      code_ = code_ << 4 | hex_value(c);
      if (--hex_left_ > 0) continue;
      if (code_ >= 0xd800 && code_ < 0xdc00) {
        high_surrogate_ = code_;
      } else if (code_ >= 0xdc00 && code_ < 0xe000 && high_surrogate_ != 0) {
        append_utf8(string_, 0x10000 + ((high_surrogate_ - 0xd800) << 10) + (code_ - 0xdc00), kMaxUriBytes);
      } else {
        append_utf8(string_, code_, kMaxUriBytes);
      }
    } else if (escape_) {
      escaped(c);
    } else if (c == '"') {
      in_string_ = false;
      string_ended();
    } else if (c == '\\') {
      escape_ = true;
    } else if (string_.size() <= kMaxUriBytes) {
      string_ += c;
    }
  }
}

}  // namespace shoal
