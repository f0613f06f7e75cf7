#include <fmt/format.h>

#include <filesystem>

#include "bench/figures.h"
#include "bench/mapped_render.h"
#include "engine/render_report.h"

namespace shoal::bench {
namespace {

/// What a run on a sample of tiles says of the whole picture. Filling the memory is paid once, however large the
/// picture, so only what is read beyond it is scaled; seconds are taken to grow as the bytes do. Both favour the rival.
struct Whole {
  double bytes = 0, seconds = 0;
  bool scaled = false;
};
Whole scale_up(double bytes, double seconds, double picture_share, double fill_bytes) {
  if (bytes <= fill_bytes || picture_share >= 1) return {bytes, seconds, false};
  const double whole = fill_bytes + (bytes - fill_bytes) / picture_share;
  return {whole, seconds * whole / bytes, true};
}

class RivalTable {
 public:
  RivalTable(const Setup& setup, const Rivals& rivals, Figure& figure)
      : setup_(setup), rivals_(rivals), figure_(figure) {
    fmt::print("{:<36} {:>10} {:>9} {:>12} {:>9} {:>13} {:>10} {:>7} {:>7}\n", "order", "memory", "tiles", "read",
               "seconds", "whole: read", "seconds", "bytes x", "time x");
  }

  void add(const std::string& name, const RenderRun& run, double read_bytes, double fill_bytes, uint64_t memory_bytes,
           bool exact) {
    if (!run.ok()) {
      fmt::print("{:<36} failed ({}, signal {}): {}\n", name, run.process.exit_code, run.process.signal,
                 run.process.output);
      figure_.ok = false;
      return;
    }
    const double share = run.stats["picture_share"];
    const Whole whole = scale_up(read_bytes, run.seconds(), share, fill_bytes);
    if (figure_.json.empty()) queued_ = whole;
    fmt::print("{:<36} {:>10} {:>7.2f} % {:>12} {:>9.2f} {:>13} {:>10.1f} {:>7.1f} {:>7.1f}{}\n", name,
               format_bytes(memory_bytes), 100 * share, format_bytes(static_cast<uint64_t>(read_bytes)), run.seconds(),
               format_bytes(static_cast<uint64_t>(whole.bytes)), whole.seconds, whole.bytes / queued_.bytes,
               whole.seconds / queued_.seconds, exact || whole.scaled ? "" : "  (too few tiles to scale)");
    std::fflush(stdout);
    figure_.json.push_back({{"order", name}, {"picture_share", share}, {"memory_bytes", memory_bytes},
                            {"read_bytes", read_bytes}, {"seconds", run.seconds()}, {"scaled", whole.scaled},
                            {"whole_read_bytes", whole.bytes}, {"whole_seconds", whole.seconds},
                            {"bytes_ratio", whole.bytes / queued_.bytes},
                            {"time_ratio", whole.seconds / queued_.seconds},
                            {"kernel_disk_read_bytes", run.process.disk_read_bytes},
                            {"major_faults_count", run.process.major_faults_count}, {"stats", run.stats}});
  }

  void add_mapped(uint64_t memory_bytes, const std::string& pages, const std::string& advice) {
    std::vector<std::string> command{setup_.this_program, "mapped-render", setup_.scene, "--pages", pages, "--advice",
                                     advice};
    // The options are those of `shoal render`, from the one after the scene on.
    RenderAsk ask;
    ask.order = "depth-first";
    ask.tile_sample = rivals_.tile_sample;
    const std::vector<std::string> words = render_command(setup_, "mapped", ask);
    command.insert(command.end(), words.begin() + 3, words.end());
    const auto group = testing::MemoryGroup::create(memory_bytes);
    if (!group.ok()) {
      fmt::print("mmap depth-first: {}: without one the file would simply fit: left out\n", group.error().message);
      return;
    }
    const RenderRun run = run_command(setup_, "mapped", command, &group.value());
    const double fill = static_cast<double>(std::min(memory_bytes, scene_sizes(setup_.scene).decoded_bytes));
    add("depth-first, mmap, advice " + advice, run, static_cast<double>(run.process.disk_read_bytes), fill,
        memory_bytes, false);
  }

 private:
  const Setup& setup_;
  const Rivals& rivals_;
  Figure& figure_;
  Whole queued_;
};

/// What a rival's page cache takes to fill, as stored.
double fill_bytes(const std::string& scene, const RenderRun& run) {
  if (!run.ok()) return 0;
  const SceneSizes sizes = scene_sizes(scene);
  return static_cast<double>(std::min<uint64_t>(run.memory("cache_bytes"), sizes.decoded_bytes)) *
         static_cast<double>(sizes.stored_bytes) / static_cast<double>(sizes.decoded_bytes);
}

}  // namespace

Figure figure_rivals(const Setup& setup, const Rivals& rivals) {
  Figure figure{Json::array()};
  const uint64_t cap = cap_for_share(setup, rivals.share);
  RivalTable table(setup, rivals, figure);
  RenderAsk ask;
  ask.max_memory_bytes = cap;
  const RenderRun queued = run_render(setup, "queued", ask);
  if (!queued.ok()) give_up("the queued render failed: " + queued.process.output);
  table.add("queued", queued, static_cast<double>(queued.disk_read_bytes()), 0, cap, true);
  std::vector<std::string> scenes = rivals.scenes;
  scenes.insert(scenes.begin(), setup.scene);
  ask.order = "depth-first";
  ask.tile_sample = rivals.tile_sample;
  for (const std::string& scene : scenes) {
    ask.scene = scene;
    const RenderRun run = run_render(setup, "depth-first", ask);
    const double read = run.ok() ? static_cast<double>(run.disk_read_bytes()) : 0;
    table.add("depth-first, " + std::filesystem::path(scene).stem().string(), run, read, fill_bytes(scene, run), cap,
              rivals.tile_sample == 1);
  }
  std::vector<std::string> advices = rivals.advices;
  std::erase(advices, "none");
  if (advices.empty()) return figure;
  const std::string pages = rivals.mapped_pages.empty() ? setup.folder + "/mapped.pages" : rivals.mapped_pages;
  if (const Status made = make_mapped_pages(setup.scene, pages); !made.ok()) give_up(made.error().message);
  for (const std::string& advice : advices) table.add_mapped(cap, pages, advice);
  return figure;
}

}  // namespace shoal::bench
