#include "bins/command_reference.h"

#include <algorithm>

#include "bins/choice_option.h"

namespace shoal {
namespace {

/// "INT" of "INT:INT in [0 - 4096]", as CLI11 joins a type and what is checked of it.
std::string type_of(const CLI::Option& option) {
  const std::string name = option.get_type_name();
  const size_t range = name.find(" in [");
  return range == std::string::npos ? name : name.substr(0, name.rfind(':', range));
}

OptionReference describe_option(const CLI::Option& option) {
  OptionReference reference;
  reference.positional = option.get_positional();
  if (reference.positional) {
    reference.names = {option.get_name(true, false)};
  } else {
    for (const std::string& name : option.get_snames()) reference.names.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) reference.names.push_back("--" + name);
  }
  if (option.get_items_expected_max() > 0) reference.value = type_of(option);
  reference.preset = option.get_default_str();
  reference.description = option.get_description();
  reference.group = option.get_group();
  reference.choices = listed_choices(reference.description);
  reference.required = option.get_required();
  reference.repeats = option.get_expected_max() > 1;
  return reference;
}

CommandReference describe_command(const CLI::App& app) {
  CommandReference command{app.get_name(), app.get_description(), app.get_footer(), {}};
  if (command.footer == app.get_parent()->get_footer()) command.footer.clear();  // inherited
  for (const CLI::Option* option : app.get_options()) {
    if (!option->get_group().empty()) command.options.push_back(describe_option(*option));
  }
  const std::vector<std::string> groups = app.get_groups();
  const auto rank = [&](const OptionReference& option) {
    return option.positional ? -1 : std::find(groups.begin(), groups.end(), option.group) - groups.begin();
  };
  std::stable_sort(command.options.begin(), command.options.end(),
                   [&](const OptionReference& a, const OptionReference& b) { return rank(a) < rank(b); });
  return command;
}

}  // namespace

ProgramReference describe_program(const CLI::App& app) {
  ProgramReference program{app.get_footer(), {}};
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (!command->get_group().empty()) program.commands.push_back(describe_command(*command));
  }
  return program;
}

}  // namespace shoal
