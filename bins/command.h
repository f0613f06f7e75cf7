// One file a subcommand: each declares its options on the CLI11 app and leaves the work to run when it was chosen.
#pragma once

#include <functional>

#include <CLI/CLI.hpp>

#include "bins/console.h"

namespace shoal {

/// Set by the chosen subcommand; returns the exit code.
using Command = std::function<int()>;

void declare_build(CLI::App& app, Console& console, Command& command);
void declare_render(CLI::App& app, Console& console, Command& command);
void declare_compare(CLI::App& app, Console& console, Command& command);
void declare_accuracy(CLI::App& app, Console& console, Command& command);
void declare_info(CLI::App& app, Console& console, Command& command);
void declare_verify(CLI::App& app, Console& console, Command& command);
void declare_diff(CLI::App& app, Console& console, Command& command);
void declare_generate(CLI::App& app, Console& console, Command& command);

inline constexpr int kExitPicturesDiffer = 10;

}  // namespace shoal
