// All that the program can be asked, as data: what the manual page and the completions of shells are written from,
// so that neither can differ from the program. Called by bins/command_help. Plain functions.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace shoal {

struct OptionReference {
  std::vector<std::string> names;  ///< "-o", "--output", in the order of help; of a positional one its name alone
  std::string value;               ///< what it takes, such as "TEXT"; empty: nothing
  std::string preset;              ///< what it is when it is not given, where help says so
  std::string description;
  std::string group;
  std::vector<std::string> choices;  ///< names that its description lists (listed_choices)
  bool positional = false, required = false, repeats = false;

  bool takes_files() const { return value == "TEXT" && choices.empty(); }
};

struct CommandReference {
  std::string name, description, footer;
  std::vector<OptionReference> options;  ///< positional ones first
};

struct ProgramReference {
  std::string footer;
  std::vector<CommandReference> commands;  ///< hidden ones left out
};

/// Of a fully declared program.
ProgramReference describe_program(const CLI::App& app);

/// The manual page, in roff.
std::string man_page(const ProgramReference& program);
/// A script for bash (loaded by bash-completion, or by `source`), and one for zsh (#compdef, in a folder of
/// $fpath).
std::string bash_completion(const ProgramReference& program);
std::string zsh_completion(const ProgramReference& program);

}  // namespace shoal
