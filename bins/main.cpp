// shoal: one program, one subcommand a task (docs/design.md). Exit codes: ErrorCode, 8 of `batch` and 10 of `diff`.
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <exception>
#include <map>
#include <new>
#include <string>
#include <string_view>
#include <vector>

#include "bins/choice_option.h"
#include "bins/command.h"
#include "engine/process_memory.h"
#include "io/child_process.h"

namespace {

void declare_console(CLI::App& app, shoal::Console& console, bool& quiet) {
  static const std::map<std::string, shoal::LogLevel> kLevels{{"error", shoal::LogLevel::kError},
                                                              {"warning", shoal::LogLevel::kWarning},
                                                              {"info", shoal::LogLevel::kInfo}};
  static const std::map<std::string, shoal::ProgressMode> kModes{{"auto", shoal::ProgressMode::kAuto},
                                                                 {"bar", shoal::ProgressMode::kBar},
                                                                 {"lines", shoal::ProgressMode::kLines},
                                                                 {"json", shoal::ProgressMode::kJson},
                                                                 {"none", shoal::ProgressMode::kNone}};
  shoal::add_choice(app, "--log-level", console.level, kLevels)->type_name("LEVEL");
  shoal::add_choice(app, "--progress", console.progress, kModes)->type_name("MODE");
  app.add_flag("--quiet", quiet, "errors only");
}

/// The words behind -- of `shoal batch`, which are no longer among the arguments afterwards.
std::vector<std::string> cut_behind_dashes(int& argc, char** argv) {
  if (argc < 2 || std::string_view(argv[1]) != "batch") return {};
  char** const end = argv + argc;
  char** const dashes = std::find_if(argv, end, [](const char* word) { return std::string_view(word) == "--"; });
  if (dashes == end) return {};
  argc = static_cast<int>(dashes - argv);
  return {dashes + 1, end};
}

int run(int argc, char** argv) {
  CLI::App app{"Shoal renders glTF scenes bigger than memory.", "shoal"};
  app.set_version_flag("--version", "shoal " SHOAL_VERSION);
  app.require_subcommand(1);
  app.footer("Exit codes: 0 done, 1 a bug of ours, 2 usage, 3 input missing or invalid, 4 a required extension is not "
             "supported,\n5 the memory cap cannot work or memory ran out, 6 disk full or I/O error, 7 a corrupt .shoal, "
             "checkpoint or part, 8 (batch) some scenes failed, 9 stopped, 10 (diff) the pictures differ.");
  shoal::Console console;
  shoal::Command command;
  shoal::declare_build(app, console, command);
  shoal::declare_render(app, console, command);
  const std::vector<std::string> behind_dashes = cut_behind_dashes(argc, argv);
  shoal::declare_batch(app, console, command, behind_dashes);
  shoal::declare_merge(app, console, command);
  shoal::declare_compare(app, console, command);
  shoal::declare_accuracy(app, console, command);
  shoal::declare_info(app, console, command);
  shoal::declare_verify(app, console, command);
  shoal::declare_diff(app, console, command);
  shoal::declare_generate(app, console, command);
  shoal::declare_help(app, console, command);
  bool quiet = false;
  for (CLI::App* subcommand : app.get_subcommands([](CLI::App*) { return true; })) {
    declare_console(*subcommand, console, quiet);
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : static_cast<int>(shoal::ErrorCode::kUsage);
  }
  if (quiet) console.level = shoal::LogLevel::kError, console.progress = shoal::ProgressMode::kNone;
  return command();
}

}  // namespace

int main(int argc, char** argv) {
  if (!shoal::end_with_parent()) return static_cast<int>(shoal::ErrorCode::kStopped);
  shoal::give_back_when_freed();
  std::signal(SIGXFSZ, SIG_IGN);  // a file larger than the user's limit is an error to report, not an end
  try {
    return run(argc, argv);
  } catch (const std::bad_alloc&) {
    std::fputs("shoal: out of memory: lower --max-memory, so that the plan fits what the machine has\n", stderr);
    return static_cast<int>(shoal::ErrorCode::kMemoryCap);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "shoal: internal error: %s\n", error.what());
    return static_cast<int>(shoal::ErrorCode::kInternal);
  }
}
