// An option whose value is one of a few names. Called by bins. CLI11's own transformer would print the numbers behind
// the names, as raw bytes, in its help and errors.
#pragma once

#include <map>
#include <string>

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
