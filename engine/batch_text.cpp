#include "engine/batch_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace shoal {
namespace {

/// Bytes of the UTF-8 character that `text` begins with; 0 when it begins with none (RFC 3629: no surrogates, nothing
/// longer than it must be, nothing beyond U+10FFFF).
size_t character_bytes(std::string_view text) {
  const auto byte = [&](size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u; };
  const unsigned first = byte(0);
  if (first < 0x80) return 1;
  const size_t bytes = first >= 0xf5 ? 0 : first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : first >= 0xc2 ? 2 : 0;
  for (size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xc0u) != 0x80u) return 0;
  }
  const unsigned second = byte(1);
  const bool bad = (first == 0xe0 && second < 0xa0) || (first == 0xed && second >= 0xa0) ||
                   (first == 0xf0 && second < 0x90) || (first == 0xf4 && second >= 0x90);
  return bad ? 0 : bytes;
}

bool is_control(char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return -1;
}

void append_percent(std::string& text, char c) {
  text += fmt::format("%{:02X}", static_cast<unsigned char>(c));
}

bool needs_no_quotes(char c) {
  const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
  return letter || std::string_view("_-./,:=+@%").find(c) != std::string_view::npos;
}

}  // namespace

std::string escape_name(std::string_view name) {
  std::string text;
  while (!name.empty()) {
    const size_t bytes = character_bytes(name);
    if (bytes == 0 || name[0] == '%' || is_control(name[0])) {
      append_percent(text, name[0]);
      name.remove_prefix(1);
    } else {
      text += name.substr(0, bytes);
      name.remove_prefix(bytes);
    }
  }
  return text;
}

std::string unescape_name(std::string_view text) {
  std::string name;
  for (size_t i = 0; i < text.size(); ++i) {
    const int high = text[i] == '%' && i + 2 < text.size() ? hex_digit(text[i + 1]) : -1;
    const int low = high >= 0 ? hex_digit(text[i + 2]) : -1;
    name += low >= 0 ? static_cast<char>(high * 16 + low) : text[i];
    if (low >= 0) i += 2;
  }
  return name;
}

std::string shell_quote(std::string_view word) {
  if (!word.empty() && std::all_of(word.begin(), word.end(), needs_no_quotes)) return std::string(word);
  if (std::none_of(word.begin(), word.end(), is_control)) {
    std::string quoted(1, '\'');
    for (const char c : word) c == '\'' ? quoted.append("'\\''") : quoted.append(1, c);
    quoted += '\'';
    return quoted;
  }
  // A line break in quotes would break the line: printf writes it. Requires that none ends the word: $() drops those.
  std::string bytes;
  for (const char c : word) {
    if (needs_no_quotes(c) && c != '%') {
      bytes += c;
    } else {
      bytes += fmt::format("\\0{:03o}", static_cast<unsigned char>(c));
    }
  }
  return fmt::format("\"$(printf %b '{}')\"", bytes);
}

std::string shell_line(const std::vector<std::string>& words) {
  std::string line;
  for (const std::string& word : words) {
    if (!line.empty()) line += ' ';
    line += shell_quote(word);
  }
  return line;
}

std::string html_escape(std::string_view text) {
  std::string html;
  for (const char c : text) {
    switch (c) {
      case '&': html += "&amp;"; break;
      case '<': html += "&lt;"; break;
      case '>': html += "&gt;"; break;
      case '"': html += "&quot;"; break;
      case '\'': html += "&#39;"; break;
      default: html += c;
    }
  }
  return html;
}

std::string html_address(std::string_view path) {
  std::string address = "./";  // so that no name is taken for a scheme
  for (const char c : path) {
    const bool plain = needs_no_quotes(c) && std::string_view("%:+@=,").find(c) == std::string_view::npos;
    if (plain) {
      address += c;
    } else {
      append_percent(address, c);
    }
  }
  return address;
}

}  // namespace shoal
