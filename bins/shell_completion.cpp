// Completions for bash and zsh, written from what the program declares.
#include <fmt/format.h>

#include <algorithm>

#include "bins/command_reference.h"

namespace shoal {
namespace {

std::string join(const std::vector<std::string>& words, const char* between) {
  return fmt::format("{}", fmt::join(words, between));
}

/// What help says behind the names of choices, or all of it, on one line and without the rest of a long one.
std::string summary(const std::string& description) {
  std::string line = description.substr(0, description.find('\n'));
  return line.substr(0, line.find("; "));
}

// ---- bash

constexpr const char* kBashHead =
    R"(# bash completion for shoal: written by the program itself (shoal help --completion bash)

# Prints the words that may begin with a dash after a command.
_shoal_options() {
  case $1 in
)";

constexpr const char* kBashMiddle = R"(  esac
}

# Prints what may follow an option of a command: its choices, or @files; nothing for a number. Fails when it takes no value.
_shoal_values() {
  case $1:$2 in
)";

constexpr const char* kBashTail = R"(    *) return 1 ;;
  esac
}

_shoal() {
  local cur=${COMP_WORDS[COMP_CWORD]} prev='' command='' values='' i
  ((COMP_CWORD > 0)) && prev=${COMP_WORDS[COMP_CWORD - 1]}
  COMPREPLY=()
  # bash takes --name=value for three words
  if [[ $cur == '=' ]]; then
    cur=''
  elif [[ $prev == '=' ]] && ((COMP_CWORD > 1)); then
    prev=${COMP_WORDS[COMP_CWORD - 2]}
  fi
  for ((i = 1; i < COMP_CWORD; i++)); do
    if [[ ${COMP_WORDS[i]} != -* ]]; then
      command=${COMP_WORDS[i]}
      break
    fi
  done
  if [[ $prev == -* && -n $command ]] && values=$(_shoal_values "$command" "$prev"); then
    :
  elif [[ $cur == -* || -z $command ]]; then
    values=$(_shoal_options "$command")
  else
    values=$(_shoal_values "$command" argument) || values=@files
  fi
  if [[ $values == @files ]]; then
    compopt -o filenames 2>/dev/null
    mapfile -t COMPREPLY < <(compgen -f -- "$cur")
  else
    mapfile -t COMPREPLY < <(compgen -W "$values" -- "$cur")
  fi
}

complete -F _shoal shoal
)";

std::string bash_options(const CommandReference& command) {
  std::vector<std::string> names;
  for (const OptionReference& option : command.options) {
    if (!option.positional) names.insert(names.end(), option.names.begin(), option.names.end());
  }
  return fmt::format("    {}) echo '{}' ;;\n", command.name, join(names, " "));
}

std::string bash_values(const CommandReference& command, const OptionReference& option) {
  if (option.value.empty()) return {};
  std::vector<std::string> patterns;
  for (const std::string& name : option.names) {
    patterns.push_back(command.name + ":" + (option.positional ? "argument" : name));
  }
  const std::string words = option.takes_files() ? "@files" : join(option.choices, " ");
  return fmt::format("    {}) echo '{}' ;;\n", join(patterns, " | "), words);
}

// ---- zsh

constexpr const char* kZshHead = R"(#compdef shoal
# zsh completion for shoal: written by the program itself (shoal help --completion zsh)

_shoal() {
  local curcontext=$curcontext state line
  typeset -A opt_args
  _arguments -C \
    '(- *)--version[print the version]' \
    '(- *)'{-h,--help}'[print help]' \
    '1:command:->command' \
    '*::argument:->argument' && return 0
  case $state in
    command)
      local -a commands
      commands=(
)";

constexpr const char* kZshMiddle = R"(      )
      _describe -t commands command commands
      ;;
    argument)
      curcontext="${curcontext%:*}-$line[1]:"
      case $line[1] in
)";

constexpr const char* kZshTail = R"(      esac
      ;;
  esac
}

_shoal "$@"
)";

/// Inside single quotes, with what _arguments and _describe read as marks made plain.
std::string zsh_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\'') {
      out += "'\\''";
      continue;
    }
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

std::string zsh_action(const OptionReference& option) {
  const std::string label = option.positional ? option.names.front() : option.value;
  std::string action = option.takes_files() ? "_files" : " ";
  if (!option.choices.empty()) action = "(" + join(option.choices, " ") + ")";
  return ":" + zsh_text(label) + ":" + action;
}

std::string zsh_option(const OptionReference& option) {
  if (option.positional)
    return fmt::format("            '{}{}' \\\n", option.repeats ? "*" : "", zsh_action(option));
  std::string lines;
  for (const std::string& name : option.names) {
    const bool stays = !option.value.empty() && option.names.size() == 1;  // may be given again, to no harm
    const std::string others = option.names.size() > 1 ? "(" + join(option.names, " ") + ")" : "";
    const bool assigns = !option.value.empty() && name.starts_with("--");
    lines += fmt::format("            '{}{}{}[{}]{}' \\\n", stays ? "*" : others, name, assigns ? "=" : "",
                         zsh_text(summary(option.description)), option.value.empty() ? "" : zsh_action(option));
  }
  return lines;
}

std::string zsh_command(const CommandReference& command) {
  std::string text = fmt::format("        {})\n          _arguments \\\n", command.name);
  for (const OptionReference& option : command.options) text += zsh_option(option);
  return text + "            && return 0\n          ;;\n";
}

}  // namespace

std::string bash_completion(const ProgramReference& program) {
  std::string text = kBashHead;
  std::vector<std::string> names;
  for (const CommandReference& command : program.commands) {
    text += bash_options(command);
    names.push_back(command.name);
  }
  text += fmt::format("    *) echo '{} --help --version' ;;\n", join(names, " "));
  text += kBashMiddle;
  for (const CommandReference& command : program.commands) {
    for (const OptionReference& option : command.options) text += bash_values(command, option);
  }
  return text + kBashTail;
}

std::string zsh_completion(const ProgramReference& program) {
  std::string text = kZshHead;
  for (const CommandReference& command : program.commands) {
    text += fmt::format("        '{}:{}'\n", command.name, zsh_text(command.description));
  }
  text += kZshMiddle;
  for (const CommandReference& command : program.commands) text += zsh_command(command);
  return text + kZshTail;
}

}  // namespace shoal
