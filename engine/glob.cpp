#include "engine/glob.h"

#include <fmt/format.h>

#include <algorithm>
#include <bitset>
#include <optional>

namespace shoal {
namespace {

enum class Kind : uint8_t { kOne, kStar, kEverything, kFolders };

struct Token {
  Kind kind = Kind::kOne;
  std::bitset<256> bytes;  ///< of kOne
};

/// What stands between [ and ], `at` behind the [; nothing when it is not closed.
std::optional<Token> parse_set(std::string_view pattern, size_t& at) {
  Token token;
  const bool others = at < pattern.size() && (pattern[at] == '!' || pattern[at] == '^');
  if (others) ++at;
  for (bool first = true; at < pattern.size() && (first || pattern[at] != ']'); first = false) {
    const auto low = static_cast<unsigned char>(pattern[at++]);
    unsigned char high = low;
    if (at + 1 < pattern.size() && pattern[at] == '-' && pattern[at + 1] != ']') {
      high = static_cast<unsigned char>(pattern[at + 1]);
      at += 2;
    }
    for (unsigned byte = low; byte <= high; ++byte) token.bytes.set(byte);
  }
  if (at >= pattern.size()) return std::nullopt;
  ++at;
  if (others) token.bytes.flip();
  token.bytes.reset('/');
  return token;
}

Token literal(char c) {
  Token token;
  token.bytes.set(static_cast<unsigned char>(c));
  return token;
}

/// Nothing when it is no pattern.
std::optional<std::vector<Token>> parse(std::string_view pattern) {
  std::vector<Token> tokens;
  for (size_t at = 0; at < pattern.size();) {
    const char c = pattern[at++];
    if (c == '*' && pattern.substr(at, 2) == "*/" && (at == 1 || pattern[at - 2] == '/')) {
      tokens.push_back({Kind::kFolders, {}});
      at += 2;
    } else if (c == '*' && pattern.substr(at, 1) == "*") {
      tokens.push_back({Kind::kEverything, {}});
      ++at;
    } else if (c == '*') {
      tokens.push_back({Kind::kStar, {}});
    } else if (c == '?') {
      tokens.push_back(literal('/'));
      tokens.back().bytes.flip();
    } else if (c == '[') {
      auto token = parse_set(pattern, at);
      if (!token) return std::nullopt;
      tokens.push_back(*token);
    } else if (c == '\\') {
      if (at == pattern.size()) return std::nullopt;
      tokens.push_back(literal(pattern[at++]));
    } else {
      tokens.push_back(literal(c));
    }
  }
  return tokens;
}

/// Of each place in the text: whether the token and all behind it match what is left. `next` is that of the token behind.
std::vector<bool> match_token(const Token& token, std::string_view text, const std::vector<bool>& next) {
  std::vector<bool> here(text.size() + 1);
  bool folder_ends = false;  // kFolders: a / lies ahead behind which the rest matches
  for (size_t i = text.size() + 1; i-- > 0;) {
    const bool more = i < text.size();
    switch (token.kind) {
      case Kind::kOne:
        here[i] = more && token.bytes.test(static_cast<unsigned char>(text[i])) && next[i + 1];
        break;
      case Kind::kStar:
        here[i] = next[i] || (more && text[i] != '/' && here[i + 1]);
        break;
      case Kind::kEverything:
        here[i] = next[i] || (more && here[i + 1]);
        break;
      case Kind::kFolders:
        folder_ends = folder_ends || (more && text[i] == '/' && next[i + 1]);
        here[i] = next[i] || folder_ends;
        break;
    }
  }
  return here;
}

}  // namespace

Status check_pattern(std::string_view pattern) {
  if (!pattern.empty() && parse(pattern)) return {};
  return Error{ErrorCode::kUsage, fmt::format("'{}' is not a pattern: expected characters, every [ closed, something "
                                              "behind every \\", pattern)};
}

bool pattern_matches(std::string_view pattern, std::string_view text) {
  const auto tokens = parse(pattern);
  SHOAL_CHECK(tokens.has_value());
  std::vector<bool> matches(text.size() + 1);
  matches.back() = true;
  for (auto token = tokens->rbegin(); token != tokens->rend(); ++token) matches = match_token(*token, text, matches);
  return matches.front();
}

bool any_matches(const std::vector<std::string>& patterns, std::string_view path) {
  for (size_t begin = 0, end = 0; end < path.size(); begin = end + 1) {
    end = std::min(path.find('/', begin), path.size());
    const auto matches = [&](const std::string& pattern) {
      const bool name_only = pattern.find('/') == std::string::npos;
      return pattern_matches(pattern, name_only ? path.substr(begin, end - begin) : path.substr(0, end));
    };
    if (std::any_of(patterns.begin(), patterns.end(), matches)) return true;
  }
  return false;
}

}  // namespace shoal
