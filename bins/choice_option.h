// An option whose value is one of a few names. Called by bins. CLI11's own transformer would print the numbers behind
// the names, as raw bytes, in its help and errors.
#pragma once

#include <algorithm>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>

#include "engine/accuracy_names.h"

namespace shoal {

/// Of such a list (engine/accuracy_names.h).
template <class T, size_t N>
std::map<std::string, T> choices_of(const NamedValue<T> (&list)[N]) {
  std::map<std::string, T> choices;
  for (const NamedValue<T>& named : list) choices.emplace(named.name, named.value);
  return choices;
}

/// "a, b, c": the names in the order of their values.
template <class T>
std::string choice_names(const std::map<std::string, T>& choices) {
  std::map<T, std::string> by_value;
  for (const auto& [name, value] : choices) by_value.emplace(value, name);
  std::string names;
  for (const auto& [value, name] : by_value) names += (names.empty() ? "" : ", ") + name;
  return names;
}

/// Choices that a description lists, as add_choice() puts them first, or behind its last colon ("which goes first: a, b, c"):
/// two words or more with ", " between them. Empty where it lists none.
inline std::vector<std::string> listed_choices(std::string_view description) {
  const auto list = [](std::string_view text) {
    std::vector<std::string> words;
    for (size_t at = 0; at <= text.size();) {
      const size_t end = std::min(text.find(", ", at), text.size());
      words.emplace_back(text.substr(at, end - at));
      const bool is_name = words.back().find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_-") == std::string::npos;
      if (!is_name || words.back().empty()) return std::vector<std::string>{};
      at = end + 2;
    }
    return words.size() > 1 ? words : std::vector<std::string>{};
  };
  const std::string_view head = description.substr(0, std::min(description.find(": "), description.find(" (")));
  if (const auto first = list(head); !first.empty()) return first;
  const size_t colon = description.rfind(": ");
  if (colon == std::string_view::npos) return {};
  const std::string_view tail = description.substr(colon + 2);
  return list(tail.substr(0, tail.find(" (")));
}

/// `value` must outlive the parse; it keeps what it holds when the option is not given.
template <class T>
CLI::Option* add_choice(CLI::App& app, const std::string& flag, T& value, const std::map<std::string, T>& choices,
                        const std::string& description = "") {
  const auto choose = [&value, flag, choices](const std::string& name) {
    const auto at = choices.find(name);
    if (at == choices.end()) {
      throw CLI::ValidationError(flag, "expected " + choice_names(choices) + ", found '" + name + "'");
    }
    value = at->second;
  };
  return app.add_option_function<std::string>(flag, choose, choice_names(choices) + description);
}

}  // namespace shoal
