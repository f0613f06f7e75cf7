// shoal help: what the build writes the manual page and the completions of shells with; not among the commands that
// --help names. Without options it prints the help.
#include <fmt/format.h>

#include <memory>

#include "bins/batch_options.h"
#include "bins/command.h"
#include "bins/command_reference.h"

namespace shoal {
namespace {

struct Arguments {
  bool man = false;
  std::string shell;
};

/// Those that `batch` passes on are declared when it runs (bins/command_batch.cpp).
ProgramReference describe_whole_program(CLI::App& app) {
  const RenderOptionRules rules = render_option_rules();
  RenderOptions given;
  declare_passed_options(*app.get_subcommand("batch"), rules, given);
  return describe_program(app);
}

int run_help(const Arguments& arguments, CLI::App& app, Console& console) {
  if (arguments.man) {
    fmt::print("{}", man_page(describe_whole_program(app)));
  } else if (arguments.shell == "bash") {
    fmt::print("{}", bash_completion(describe_whole_program(app)));
  } else if (arguments.shell == "zsh") {
    fmt::print("{}", zsh_completion(describe_whole_program(app)));
  } else if (arguments.shell.empty()) {
    fmt::print("{}", app.help("", CLI::AppFormatMode::Normal));
  } else {
    return console.error(
        {ErrorCode::kUsage, fmt::format("--completion {}: expected bash or zsh", arguments.shell)});
  }
  return 0;
}

}  // namespace

void declare_help(CLI::App& app, Console& console, Command& command) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = app.add_subcommand("help", "the manual page, and completions for shells")->group("");
  sub->add_flag("--man", arguments->man, "the manual page, in roff");
  sub->add_option("--completion", arguments->shell, "of a shell: bash, zsh")->type_name("SHELL");
  sub->callback([arguments, &app, &console, &command] {
    command = [arguments, &app, &console] { return run_help(*arguments, app, console); };
  });
}

}  // namespace shoal
