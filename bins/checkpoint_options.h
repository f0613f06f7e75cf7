// The options of `shoal render` that say what becomes of a render that is stopped, and which part of it is rendered:
// --checkpoint, --resume, --sample-range. Called by bins/command_render.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "bins/console.h"
#include "engine/checkpoint_options.h"
#include "engine/sample_order.h"
#include "io/result.h"

namespace shoal {

struct CheckpointArguments {
  std::string when = "on-stop", range;
  bool resume = false;

  void declare(CLI::App& app);
};

/// "90", "30s", "10m", "1h", "1d": more than 0 seconds. Fails with: kUsage.
Result<double> parse_duration(const std::string& text);
/// "A:B": the samples from A on, before B; empty: none. Fails with: kUsage.
Result<SampleSpan> parse_sample_range(const std::string& text);

/// Of a picture that goes to `output`: its checkpoint is `output`.checkpoint. Says whether it goes on from one.
/// Fails with: kUsage, and as SumsFile::open().
Result<CheckpointOptions> checkpoint_options(const CheckpointArguments& arguments, const std::string& output,
                                             Console& console);
/// The same without looking. Fails with: kUsage.
Status check_checkpoint_arguments(const CheckpointArguments& arguments);

/// The picture is complete: its checkpoint goes, whoever wrote it.
void remove_checkpoint(const CheckpointOptions& options);

}  // namespace shoal
