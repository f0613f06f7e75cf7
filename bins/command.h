// One file a subcommand: each declares its options on the CLI11 app and leaves the work to run when it was chosen.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "bins/console.h"

namespace shoal {

/// Set by the chosen subcommand; returns the exit code.
using Command = std::function<int()>;

void declare_build(CLI::App& app, Console& console, Command& command);
void declare_render(CLI::App& app, Console& console, Command& command);
void declare_merge(CLI::App& app, Console& console, Command& command);
void declare_compare(CLI::App& app, Console& console, Command& command);
void declare_accuracy(CLI::App& app, Console& console, Command& command);
void declare_info(CLI::App& app, Console& console, Command& command);
void declare_verify(CLI::App& app, Console& console, Command& command);
void declare_diff(CLI::App& app, Console& console, Command& command);
void declare_generate(CLI::App& app, Console& console, Command& command);
void declare_help(CLI::App& app, Console& console, Command& command);

/// `behind_dashes`: the words behind --, which CLI11 would take for positional ones.
void declare_batch(CLI::App& app, Console& console, Command& command, const std::vector<std::string>& behind_dashes);

inline constexpr int kExitBatchFailed = 8;
inline constexpr int kExitPicturesDiffer = 10;

}  // namespace shoal
