#include "bins/compare_levels.h"

#include <fmt/format.h>

#include <algorithm>
#include <thread>

namespace shoal {
namespace {

constexpr const char* kModelHelp =
    "do not render once more in each order with what tracing touches told to a model of the processor's caches: no "
    "misses and memory bytes a ray are shown (timed runs know nothing of the model)";

/// So many rays take half a minute of processor time by the model of all sets (docs/measuring.md); more are modelled by
/// one in kSetsOfManyRays.
constexpr uint64_t kRaysForAllSets = 4'000'000;
constexpr uint32_t kSetsOfManyRays = 16;

/// Why this render cannot be modelled; empty: it can.
std::string why_not(const LevelArguments& arguments, const PreparedRender& prepared) {
  if (!arguments.model) return "not asked for";
  if (prepared.picture.shading.triangle_test != TriangleTest::kWatertight) {
    return "only kernels of --triangle-test watertight tell what they touch";
  }
  return "";
}

/// Of the model, by all threads.
uint64_t model_bytes(const CacheModel::Options& options, unsigned threads) {
  uint64_t lines = 0;
  for (size_t i = 0; i < options.levels.size(); ++i) {
    const bool own = options.levels.size() == 1 || i + 1 < options.levels.size();
    lines += options.levels[i].bytes / options.levels[i].line_bytes * (own ? threads : 1);
  }
  constexpr uint64_t kLogBytes = 64u << 10;
  return lines / options.one_in * sizeof(uint64_t) + threads * kLogBytes;
}

}  // namespace

void LevelArguments::declare(CLI::App& app) {
  app.add_flag("--no-cache-model{false}", model, kModelHelp);
  app.add_option(
      "--cache-levels", cache_levels,
      "caches to model, the innermost first, as SIZE:WAYS,..., such as 48K:12,2M:16,105M:15; the last of two "
      "or more is shared by all threads (default: those of this machine)");
  app.add_option("--cache-sets", cache_sets,
                 "model one in so many sets of every cache, a power of two: faster, less sure of L1 (default: all of "
                 "up to 4 million rays, else one in 16)");
}

Result<CacheModel::Options> LevelArguments::options(uint64_t rays) const {
  CacheModel::Options options{.levels = machine_cache_levels().shapes, .one_in = std::max(cache_sets, 1u)};
  if (!cache_levels.empty()) {
    SHOAL_ASSIGN_OR_RETURN(options.levels, parse_cache_levels(cache_levels));
  }
  SHOAL_RETURN_IF_ERROR(options.check());
  if (cache_sets > 0 || rays <= kRaysForAllSets) return options;
  for (options.one_in = kSetsOfManyRays; !options.check().ok();) options.one_in /= 2;  // of small caches fewer
  return options;
}

Result<std::vector<float>> model_order(const LevelArguments& arguments, const PreparedRender& prepared,
                                       const ExecutionOptions& execution, Console& console, LevelFigures& figures) {
  figures.no_touches = why_not(arguments, prepared);
  if (!figures.no_touches.empty()) return std::vector<float>();
  SHOAL_ASSIGN_OR_RETURN(const CacheModel::Options options, arguments.options(figures.rays));
  figures.cache_source = arguments.cache_levels.empty() ? machine_cache_levels().source : "given";
  TouchRecorder recorder(options);
  ExecutionOptions modelled = execution;
  modelled.touches = &recorder;
  const unsigned threads =
      execution.threads != 0 ? execution.threads : std::max(1u, std::thread::hardware_concurrency());
  modelled.process_bytes += model_bytes(options, threads);
  console.info(fmt::format("{}: modelling caches of {} ({})", figures.title, cache_levels_text(options.levels),
                           figures.cache_source));
  auto result = render(posix_file_system(), prepared.scene, prepared.picture, modelled, console_hooks(console));
  console.end_progress();
  if (!result.ok()) {
    if (result.error().code != ErrorCode::kMemoryCap) return std::move(result).error();
    figures.no_touches = "no room for the model under the cap: " + result.error().message;
    return std::vector<float>();
  }
  figures.touches = recorder.report();
  figures.threads = result.value().threads;
  figures.modelled_seconds = result.value().seconds;
  figures.rays = result.value().counters.total().rays_traced_count;
  return std::move(result.value().rgba);
}

}  // namespace shoal
