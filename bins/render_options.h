// The options that `render` and `compare` share, and what they do with them: find or build the .shoal, open it, choose
// the sky. Called by bins.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "bins/console.h"
#include "bins/stop_signals.h"
#include "engine/build_scene.h"
#include "engine/render.h"
#include "io/result.h"

namespace shoal {

/// "64K", "2G", "1048576": binary units. Fails with: kUsage.
Result<uint64_t> parse_size(const std::string& text);
/// A size between 4K and 4M. Fails with: kUsage.
Result<uint32_t> parse_treelet_size(const std::string& text);
/// "constant:R,G,B", "F.hdr", "F.exr". Fails with: kUsage.
Result<EnvironmentOptions> parse_environment(const std::string& text);

/// "queued" or "depth-first". Fails with: kUsage.
Result<Order> parse_order(const std::string& name);
/// Both, by name.
const std::map<std::string, Order>& order_choices();

/// Whether a file can be put at `path`: its folder is there and can be written, and what is there already is a file (the
/// rename would take the place of a device or a pipe as well). Asked before long work. Fails with: kStorage.
Status check_output(const std::string& path);

/// The help of --max-memory, which `build` has as well.
inline constexpr const char* kMaxMemoryHelp =
    "cap on the whole process, such as 2G (default: 70 % of the smaller of physical memory and control-group limits)";

inline constexpr const char* kVariantHelp =
    "name of one of the scene's material variants (default: the materials that it shows without one)";

/// --time and --animation, which `build` has as well.
void declare_pose(CLI::App& app, PoseOptions& pose);

/// Options as they stand on the command line.
struct RenderArguments {
  std::string scene, environment, max_memory, page_cache, treelet_size, cache_folder, scratch_folder, variant, effects;
  PoseOptions pose;
  std::optional<PositionPrecision> positions;  ///< none: exact, or those of the .shoal
  std::optional<BvhBuilder> builder;           ///< none: SAH, or that of the .shoal
  PictureOptions picture;
  ExecutionOptions execution;
  bool buffered_reads = false, allow_stale = false, discard_built = false;
  uint32_t more_levels = 32;
  CLI::Option* samples = nullptr;  ///< --spp
  std::function<void(SceneBuildOptions&)> adjust_build;  ///< may be empty; of the options that a glTF is built with

  void declare(CLI::App& app);
};

/// A scene ready to render, with the options resolved.
struct PreparedRender {
  Scene scene;
  PictureOptions picture;
  ExecutionOptions execution;
  SceneBuildOptions build;              ///< what a glTF was built with, now or before
  std::optional<double> build_seconds;  ///< where it was built now
};
/// Builds first where needed (into the cache folder, keyed by content), opens, parses sizes and environment. The cap must
/// fit every one of `orders`, beside `pictures_kept` pictures of the same size.
Result<PreparedRender> prepare_render(const RenderArguments& arguments, const std::vector<Order>& orders,
                                      uint32_t pictures_kept, Console& console);

/// Hooks that show progress and stop on SIGINT and SIGTERM.
RenderHooks console_hooks(Console& console);
/// The memory plan as one log line.
std::string describe_plan(const MemoryPlan& plan);
/// The samples that pixels got, and the noise that is left, as one log line.
std::string describe_samples(const RenderResult& result);
/// The order that was chosen, and why, as one log line.
std::string describe_order(const ChosenOrder& chosen);
std::string describe_plan(const BuildMemoryPlan& plan);
/// Build progress on the console.
std::function<void(const BuildProgress&)> build_progress(Console& console);

}  // namespace shoal
