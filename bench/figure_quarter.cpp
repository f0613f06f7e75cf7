#include <fmt/format.h>

#include "bench/figures.h"
#include "engine/render_report.h"

namespace shoal::bench {
namespace {

struct Column {
  const char* name;
  RenderAsk ask;
  std::vector<double> seconds;
  RenderRun last;
};

/// Runs it once more; false when it failed or gave another picture than `first`.
bool run_once(const Setup& setup, Column& column, const RenderRun* first) {
  column.last = run_render(setup, column.name, column.ask);
  if (!column.last.ok()) {
    fmt::print("{} failed: {}\n", column.name, column.last.process.output);
    return false;
  }
  column.seconds.push_back(column.last.seconds());
  return first == nullptr || same_picture(setup, *first, column.last);
}

}  // namespace

Figure figure_quarter(const Setup& setup, double share, bool warm) {
  Figure figure;
  const SceneSizes sizes = scene_sizes(setup.scene);
  const uint64_t cap = cap_for_share(setup, share);
  std::vector<Column> columns{{"part", {}, {}, {}}, {"all-cold", {}, {}, {}}};
  columns[0].ask.max_memory_bytes = cap;
  if (warm) {
    columns.push_back({"all-warm", {}, {}, {}});
    columns.back().ask.more = {"--buffered-reads"};
  }
  fmt::print("{}: {} treelets, {} of pages decoded, {} stored; cap {}\n", setup.scene, sizes.treelets_count,
             format_bytes(sizes.decoded_bytes), format_bytes(sizes.stored_bytes), format_bytes(cap));
  // Once without counting, so that the operating system's cache holds the file for the warm runs if it can.
  if (warm) figure.ok = run_render(setup, "all-warm", columns.back().ask).ok();
  for (uint32_t run = 0; run < setup.runs && figure.ok; ++run) {
    for (Column& column : columns) {
      figure.ok = figure.ok && run_once(setup, column, &column == &columns[0] ? nullptr : &columns[0].last);
    }
  }
  fmt::print("{:<10} {:>10} {:>12} {:>9} {:>12} {:>12} {:>8}\n", "pages", "cap", "page cache", "of all", "from disk",
             "seconds", "ratio");
  for (const Column& column : columns) {
    if (!figure.ok) break;
    const double seconds = median(column.seconds);
    const double cache_share = std::min(1.0, static_cast<double>(column.last.memory("cache_bytes")) /
                                                 static_cast<double>(sizes.decoded_bytes));
    fmt::print("{:<10} {:>10} {:>12} {:>7.1f} % {:>12} {:>12.2f} {:>8.2f}\n", column.name,
               format_bytes(column.last.memory("cap_bytes")), format_bytes(column.last.memory("cache_bytes")),
               100 * cache_share, format_bytes(column.last.disk_read_bytes()), seconds,
               median(columns[0].seconds) / seconds);
    figure.json["rows"].push_back({{"pages", column.name}, {"median_seconds", seconds}, {"seconds", column.seconds},
                                   {"cache_share", cache_share},
                                   {"kernel_disk_read_bytes", column.last.process.disk_read_bytes},
                                   {"stats", column.last.stats}});
  }
  fmt::print("pictures: {}\n", figure.ok ? "identical" : "DIFFERENT or missing");
  figure.json["pictures_identical"] = figure.ok;
  return figure;
}

}  // namespace shoal::bench
