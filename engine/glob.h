// Patterns of file names: --include and --exclude of `shoal batch`. Called by engine/find_scenes. Plain functions.
// Cost: length of the pattern times that of the path, whatever either holds.
//
//   *  any characters but /      ?  one of them      [a-z] [!a-z]  one of these, one of the others
//   ** any characters            **/  any folders, or none         \x  the character x
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "io/result.h"

namespace shoal {

/// Fails with: kUsage (empty, a [ that is not closed, a \ at the end).
Status check_pattern(std::string_view pattern);

/// Whether the pattern, which check_pattern() accepts, is that of the whole text.
bool pattern_matches(std::string_view pattern, std::string_view text);

/// Whether a pattern is that of the path or of a folder above it: `path` is relative, with / between names. A pattern
/// without / is compared with single names, another one with the path from its beginning.
bool any_matches(const std::vector<std::string>& patterns, std::string_view path);

}  // namespace shoal
