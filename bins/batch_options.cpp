#include "bins/batch_options.h"

#include <memory>
#include <set>

#include "bins/command.h"

namespace shoal {
namespace {

/// Chosen by the batch, or of no use in one.
const std::set<std::string>& kept_back() {
  static const std::set<std::string> kNames{"help",       "output",  "png",           "preview", "stats",       "cache-dir",
                                            "max-memory", "threads", "discard-built", "resume",  "sample-range", "trace"};
  return kNames;
}

/// `shoal render`, declared to be asked, never run.
struct RenderDeclaration {
  CLI::App app{"", "shoal"};
  Console console;
  Command command;

  RenderDeclaration() { declare_render(app, console, command); }

  /// Name without dashes and option, of each that may be passed on.
  std::vector<std::pair<std::string, const CLI::Option*>> passed() {
    std::vector<std::pair<std::string, const CLI::Option*>> options;
    for (const CLI::Option* option : app.get_subcommand("render")->get_options()) {
      if (option->get_lnames().empty() || kept_back().contains(option->get_lnames().front())) continue;
      options.emplace_back(option->get_lnames().front(), option);
    }
    return options;
  }
};

bool takes_value(const CLI::Option& option) { return option.get_items_expected_max() > 0; }

Status check_value(const std::string& name, const std::string& value) {
  RenderDeclaration render;
  const std::string word = "--" + name + "=" + value;
  const char* words[] = {"shoal", "render", "scene", "-o", "picture", word.c_str()};
  try {
    render.app.parse(static_cast<int>(std::size(words)), words);
  } catch (const CLI::ParseError& error) {
    return Error{ErrorCode::kUsage, error.what()};
  }
  return {};
}

}  // namespace

RenderOptionRules render_option_rules() {
  RenderOptionRules rules;
  RenderDeclaration render;
  for (const auto& [name, option] : render.passed()) rules.takes_value[name] = takes_value(*option);
  rules.check = check_value;
  return rules;
}

void declare_passed_options(CLI::App& app, const RenderOptionRules& rules, RenderOptions& given) {
  RenderDeclaration render;
  for (const auto& [name, option] : render.passed()) {
    const std::string group = option->get_group() == "Options" ? "Options of every render" : option->get_group();
    if (!takes_value(*option)) {
      app.add_flag_callback("--" + name, [&given, name] { given[name] = "true"; }, option->get_description())->group(group);
      continue;
    }
    app.add_option_function<std::string>(
           "--" + name,
           [&given, &rules, name](const std::string& value) {
             if (const Status status = rules.check(name, value); !status.ok()) {
               throw CLI::ValidationError(status.error().message);
             }
             given[name] = value;
           },
           option->get_description())
        ->type_name(option->get_type_name())
        ->default_str(option->get_default_str())
        ->group(group);
  }
}

}  // namespace shoal
