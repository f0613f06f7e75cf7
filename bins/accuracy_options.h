// The options that trade accuracy for time (docs/sampling.md), of `render`, `compare`, `accuracy` and `batch`. Called by bins.
#pragma once

#include <CLI/CLI.hpp>

#include "engine/render.h"

namespace shoal {

/// Under a heading of their own; --seed beside them.
void declare_accuracy(CLI::App& app, PictureOptions& picture);

}  // namespace shoal
