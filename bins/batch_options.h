// The options of `shoal render` as `shoal batch` passes them on: read from the very declarations of `render`, so that the
// two cannot differ. Called by bins/command_batch.
#pragma once

#include <CLI/CLI.hpp>

#include "engine/batch_options.h"

namespace shoal {

/// Every option of `render` but those that the batch chooses itself.
RenderOptionRules render_option_rules();

/// Declares all of them on `app`; those that are given end up in `given`, which must outlive the parse as `rules` must.
void declare_passed_options(CLI::App& app, const RenderOptionRules& rules, RenderOptions& given);

}  // namespace shoal
