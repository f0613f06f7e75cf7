// --builder of `build` and of what builds on its way. Called by bins.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>

#include "engine/scene.h"
#include "treelets/bvh_builder_kind.h"

namespace shoal {

/// Returns the option, for it to be put into a group.
CLI::Option* declare_builder(CLI::App& app, std::optional<BvhBuilder>& builder);
/// "sah", "lbvh", "karras". Fails with: kUsage.
Result<BvhBuilder> parse_builder(const std::string& name);
/// A .shoal has the trees that it was built with, and cannot be asked for others. Fails with: kUsage.
Status check_builder(const Scene& scene, std::optional<BvhBuilder> asked);

}  // namespace shoal
