#include <fmt/format.h>

#include <algorithm>

#include "bench/figures.h"
#include "engine/render_report.h"

namespace shoal::bench {
namespace {

struct SplitRow {
  uint64_t paths = 0;
  std::vector<double> seconds;
  RenderRun run;  ///< the last one
};

Json row_json(double share, uint64_t cap, const SplitRow& row, bool chosen) {
  return {{"share", share}, {"cap_bytes", cap}, {"chosen", chosen}, {"paths_in_flight", row.paths},
          {"cache_bytes", row.run.memory("cache_bytes")}, {"median_seconds", median(row.seconds)},
          {"seconds", row.seconds}, {"disk_read_bytes", row.run.disk_read_bytes()}, {"stats", row.run.stats}};
}

void print_row(const SplitRow& row, double best_seconds, bool chosen) {
  fmt::print("{:>10} {:>12} {:>12} {:>9.2f} {:>8.2f} {:>12}{}\n", row.paths,
             format_bytes(row.run.memory("path_state_bytes") + row.run.memory("ray_bytes")),
             format_bytes(row.run.memory("cache_bytes")), median(row.seconds), median(row.seconds) / best_seconds,
             format_bytes(row.run.disk_read_bytes()), chosen ? "  <- chosen" : "");
}

}  // namespace

Figure figure_split(const Setup& setup, const std::vector<double>& shares, const std::vector<double>& factors) {
  Figure figure{Json::array()};
  const SceneSizes sizes = scene_sizes(setup.scene);
  for (const double share : shares) {
    RenderAsk ask;
    ask.max_memory_bytes = cap_for_share(setup, share);
    std::vector<SplitRow> rows(1);
    rows[0].run = run_render(setup, "split-chosen", ask);
    if (!rows[0].run.ok()) give_up(rows[0].run.process.output);
    rows[0].paths = rows[0].run.memory("paths_in_flight_count");
    for (const double factor : factors) {
      if (factor != 1) rows.push_back({static_cast<uint64_t>(factor * static_cast<double>(rows[0].paths)), {}, {}});
    }
    for (uint32_t turn = 0; turn < setup.runs; ++turn) {  // turn by turn, so that what else runs harms all alike
      for (SplitRow& row : rows) {
        if (turn > 0 && !row.run.ok()) continue;  // no room for so many
        const bool chosen = &row == &rows[0];
        ask.rays_in_flight = chosen ? 0 : 2 * row.paths;
        if (turn > 0 || !chosen) row.run = run_render(setup, chosen ? "split-chosen" : "split", ask);
        if (row.run.ok()) row.seconds.push_back(row.run.seconds());
        const bool refused = row.run.process.exit_code == 5;
        figure.ok = figure.ok && (refused || (row.run.ok() && same_picture(setup, rows[0].run, row.run)));
      }
    }
    std::erase_if(rows, [](const SplitRow& row) { return row.seconds.empty(); });
    double best = median(rows[0].seconds);
    for (const SplitRow& row : rows) best = std::min(best, median(row.seconds));
    fmt::print("{}: {} of pages decoded, cap {} ({:.0f} % of the pages in the cache with the split that is chosen)\n",
               setup.scene, format_bytes(sizes.decoded_bytes), format_bytes(ask.max_memory_bytes), 100 * share);
    fmt::print("{:>10} {:>12} {:>12} {:>9} {:>8} {:>12}\n", "paths", "paths take", "page cache", "seconds", "of best",
               "from disk");
    const uint64_t chosen_paths = rows[0].paths;
    std::sort(rows.begin(), rows.end(), [](const SplitRow& a, const SplitRow& b) { return a.paths < b.paths; });
    for (const SplitRow& row : rows) {
      print_row(row, best, row.paths == chosen_paths);
      figure.json.push_back(row_json(share, ask.max_memory_bytes, row, row.paths == chosen_paths));
    }
    std::fflush(stdout);
  }
  return figure;
}

}  // namespace shoal::bench
