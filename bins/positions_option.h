// --positions of `build` and of what builds on its way. Called by bins.
#pragma once

#include <optional>

#include <CLI/CLI.hpp>

#include "engine/position_grid.h"
#include "engine/scene.h"

namespace shoal {

void declare_positions(CLI::App& app, std::optional<PositionPrecision>& positions);
/// A .shoal has the positions that it was built with, and cannot be asked for others. Fails with: kUsage.
Status check_positions(const Scene& scene, std::optional<PositionPrecision> asked);

}  // namespace shoal
