// A headless Chromium for the pages that the program writes: $SHOAL_CHROMIUM, or one in the path by its usual names. Used by
// tests/bins, which skip what needs one where there is none.
#pragma once

#include <string>
#include <vector>

#include "tests/bins/program.h"

namespace shoal::testing {

/// The path of a Chromium; empty without one.
std::string chromium(const TemporaryFolder& folder);

/// Opens a page without a network, lets its scripts run, and prints the document as it is then; what the page complained of
/// is in `err` with the word CONSOLE. `more`: options of Chromium.
ProgramRun open_page(const TemporaryFolder& folder, const std::string& page, const std::vector<std::string>& more = {});

/// What the first group of `pattern` matches, again and again.
std::vector<std::string> all_matches(const std::string& text, const std::string& pattern);

/// Between two marks, the first of each; empty without them.
std::string between(const std::string& text, const std::string& from, const std::string& to);

}  // namespace shoal::testing
