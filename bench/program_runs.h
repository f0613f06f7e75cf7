// Renders and builds by the program itself, a process each, with the figures that it wrote (--stats) beside those
// that the kernel counted. Used by the figures of bench/out_of_core. One thread; one program at a time.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tests/support/memory_group.h"

namespace shoal::bench {

using Json = nlohmann::ordered_json;

/// What all figures have in common; filled from the command line.
struct Setup {
  std::string program;      ///< shoal
  std::string this_program;  ///< for the runs that shoal itself has no order for
  std::string folder;       ///< for pictures and other temporary files
  std::string scene;        ///< .shoal
  uint32_t width = 1920, height = 1080, samples = 4, bounces = 4, runs = 3, threads = 0;
};

/// What a run is given beside the setup; 0 and empty: the program's own choice.
struct RenderAsk {
  std::string scene;             ///< empty: the setup's
  std::string order = "queued";
  uint64_t max_memory_bytes = 0, page_cache_bytes = 0, rays_in_flight = 0;
  uint32_t tile_sample = 1, samples = 0;
  std::vector<std::string> more;  ///< further options of `shoal render`
};

struct RenderRun {
  std::string name;  ///< of the picture and the stats: they stay in the setup's folder
  testing::MeasuredRun process;
  Json stats;  ///< null when the program failed

  bool ok() const { return process.exit_code == 0 && !stats.is_null(); }
  uint64_t total(const char* counter) const { return stats["counters"]["totals"][counter]; }
  uint64_t memory(const char* part) const { return stats["memory"][part]; }
  double seconds() const { return stats["render_seconds"]; }
  uint64_t disk_read_bytes() const { return total("disk_read_bytes"); }
};

/// `shoal render`; leaves <folder>/<name>.exr and .json.
RenderRun run_render(const Setup& setup, const std::string& name, const RenderAsk& ask,
                     const testing::MemoryGroup* group = nullptr);
/// The words of that command.
std::vector<std::string> render_command(const Setup& setup, const std::string& name, const RenderAsk& ask);
/// Runs it and reads the stats that it is to leave as <folder>/<name>.json.
RenderRun run_command(const Setup& setup, const std::string& name, const std::vector<std::string>& command,
                      const testing::MemoryGroup* group);

/// Whether `shoal diff` finds the pictures of two runs the same to the bit.
bool same_picture(const Setup& setup, const RenderRun& a, const RenderRun& b);

/// What a scene weighs; read from its directory of pages.
struct SceneSizes {
  uint64_t decoded_bytes = 0;  ///< all pages as they lie in the page cache
  uint64_t stored_bytes = 0;   ///< all pages as they are read from disk: whole blocks
  uint64_t treelets_count = 0;
  uint64_t treelets_decoded_bytes = 0, treelets_stored_bytes = 0;  ///< of geometry alone
};
SceneSizes scene_sizes(const std::string& scene);

/// The memory cap at which a queued render plans a page cache of about `share` of all pages: found by trying.
uint64_t cap_for_share(const Setup& setup, double share);

double median(std::vector<double> values);
/// Ends the figure, and the program with exit code 1: throws this sentence.
[[noreturn]] void give_up(const std::string& sentence);

}  // namespace shoal::bench
