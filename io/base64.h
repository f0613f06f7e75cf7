// Base64 (RFC 4648 section 4), as data: URIs carry it. Called by the glTF reader and the writer of report pages. Cost: one
// table look-up a character.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace shoal {

/// Padding may be missing; nothing when a character is outside the alphabet or the length is impossible.
std::optional<std::vector<std::byte>> decode_base64(std::string_view text);
/// With padding, in one line.
std::string encode_base64(std::span<const std::byte> bytes);

}  // namespace shoal
