// Traffic at each level in `shoal compare`: the options, the modelled run of each order, and counters of the
// hardware around the timed ones. Called by bins/command_compare. docs/measuring.md "Traffic at each level".
#pragma once

#include <CLI/CLI.hpp>

#include "bins/console.h"
#include "bins/render_options.h"
#include "engine/level_report.h"

namespace shoal {

struct LevelArguments {
  bool model = true;
  std::string cache_levels;  ///< empty: the machine's
  uint32_t cache_sets = 0;   ///< one in so many is modelled; 0: by the number of rays

  void declare(CLI::App& app);
  /// What to model of so many rays. Fails with: kUsage.
  Result<CacheModel::Options> options(uint64_t rays) const;
};

/// Renders once more in the order of `execution`, every touch told to a model of the caches, into `figures`: what
/// is found, or why there is nothing. Returns the picture, empty where there is none. Fails with: as render().
Result<std::vector<float>> model_order(const LevelArguments& arguments, const PreparedRender& prepared,
                                       const ExecutionOptions& execution, Console& console, LevelFigures& figures);

}  // namespace shoal
