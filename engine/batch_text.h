// Names of files, which may be any bytes, as text: for JSON and people, for a shell, for HTML. Called by engine/batch_*
// and bins. Plain functions. Cost: one pass.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace shoal {

/// Always UTF-8 on one line: '%', control characters and bytes that are not UTF-8 become %XX.
std::string escape_name(std::string_view name);
/// The bytes that escape_name() was given.
std::string unescape_name(std::string_view text);

/// One word of a POSIX shell, on one line. A line break at the very end of the word is lost.
std::string shell_quote(std::string_view word);
/// Words as one line.
std::string shell_line(const std::vector<std::string>& words);

/// Text for HTML, also inside of quotes.
std::string html_escape(std::string_view text);
/// A path relative to the page, as an address.
std::string html_address(std::string_view path);

}  // namespace shoal
