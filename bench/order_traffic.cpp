// bench/order_traffic: the same picture queued and depth-first, with the page cache at 100, 50, 25 and 10 % of the
// scene's pages. Warm program, cold page cache (each run starts with an empty one; reads are direct, so that the
// operating system's cache does not serve them). Median and range of several runs; the pictures must be identical.
//
//   bench/order_traffic [--triangles N] [--scene F.shoal] [--runs N] [--size PIXELS] [--spp N] [--short] [--json F]
#include <fmt/format.h>

#include <algorithm>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include <CLI/CLI.hpp>

#include "engine/build_scene.h"
#include "engine/generate.h"
#include "engine/render.h"
#include "engine/render_report.h"
#include "io/page_cache.h"

namespace {

using namespace shoal;
using Json = nlohmann::ordered_json;

struct Arguments {
  uint64_t triangles = 2'000'000;
  std::string scene, json;
  int runs = 3;
  uint32_t side = 96, samples = 1;  ///< small: depth-first with a tenth of the pages reads 0.5 MB a path
  bool brief = false;
};

struct Row {
  Order order;
  double share;  ///< of the scene's pages that the cache may hold
  std::vector<double> seconds;
  RenderResult result;  ///< of the last run
};

[[noreturn]] void stop(const Error& error) {
  fmt::print(stderr, "order_traffic: {}\n", error.message);
  std::exit(static_cast<int>(error.code));
}

template <class T>
T value_or_stop(Result<T> result) {
  if (!result.ok()) stop(result.error());
  return std::move(result).value();
}

std::string generated_scene(const Arguments& arguments, const std::filesystem::path& folder) {
  GenerateOptions options;
  options.kind = "terrain";
  options.triangles = arguments.triangles;
  options.out_dir = folder.string();
  const GenerateReport report = value_or_stop(generate_scene(posix_file_system(), options));
  const std::string path = (folder / "terrain.shoal").string();
  value_or_stop(build_scene(posix_file_system(), report.gltf_path, path, {}));
  return path;
}

Row run_row(const Arguments& arguments, const Scene& scene, Order order, double share) {
  Row row{order, share, {}, {}};
  PictureOptions picture;
  picture.width = picture.height = arguments.side;
  picture.samples = arguments.samples;
  picture.shading.bounces = 4;
  ExecutionOptions execution;
  execution.order = order;
  execution.threads = std::max(1u, std::thread::hardware_concurrency());
  const uint64_t pages = decoded_page_bytes(*scene.file);
  execution.page_cache_bytes = std::max(static_cast<uint64_t>(static_cast<double>(pages) * share),
                                        PageCache::minimum_capacity_bytes(*scene.file, execution.threads));
  for (int run = 0; run < arguments.runs; ++run) {
    row.result = value_or_stop(render(posix_file_system(), scene, picture, execution));
    row.seconds.push_back(row.result.seconds);
  }
  std::sort(row.seconds.begin(), row.seconds.end());
  return row;
}

void print_row(const Row& row) {
  const RayCounters rays = row.result.counters.total();
  const double median = row.seconds[row.seconds.size() / 2];
  fmt::print("{:<12} {:>5.0f} % {:>9.2f} [{:.2f}, {:.2f}] {:>10.3f} {:>12} {:>9} {:>10.1f} {:>12.1f}\n",
             order_name(row.order), row.share * 100, median, row.seconds.front(), row.seconds.back(),
             static_cast<double>(rays.rays_traced_count) / median * 1e-6,
             format_bytes(row.result.counters.disk_read_bytes), row.result.counters.treelet_loads_count,
             static_cast<double>(row.result.counters.disk_read_bytes) / static_cast<double>(rays.rays_traced_count),
             static_cast<double>(row.result.counters.treelet_visits_count) /
                 static_cast<double>(row.result.counters.treelet_batches_count));
  std::fflush(stdout);
}

Json row_json(const Row& row) {
  const RenderCounters& c = row.result.counters;
  return {{"order", order_name(row.order)},
          {"cache_share", row.share},
          {"cache_bytes", row.result.plan.cache_bytes},
          {"median_seconds", row.seconds[row.seconds.size() / 2]},
          {"seconds", row.seconds},
          {"rays_traced_count", c.total().rays_traced_count},
          {"disk_read_bytes", c.disk_read_bytes},
          {"treelet_loads_count", c.treelet_loads_count},
          {"treelet_visits_count", c.treelet_visits_count},
          {"treelet_batches_count", c.treelet_batches_count}};
}

int run(const Arguments& arguments) {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / fmt::format("shoal-bench-{}", ::getpid());
  std::string path = arguments.scene;
  if (path.empty()) path = generated_scene(arguments, folder);
  const Scene scene = value_or_stop(open_scene(posix_file_system(), path, ReadMode::kDirect, {}));
  fmt::print("{}: {} triangles, {} treelets, {} of pages; {} x {}, {} spp, 4 bounces, {} runs\n", path,
             scene.header.triangles_count, scene.treelets.size(),
             format_bytes(scene.header.geometry_bytes + scene.header.attribute_bytes + scene.header.texture_bytes),
             arguments.side, arguments.side, arguments.samples, arguments.runs);
  fmt::print("{:<12} {:>7} {:>23} {:>10} {:>12} {:>9} {:>10} {:>12}\n", "order", "cache", "seconds (median, range)",
             "Mrays/s", "from disk", "loads", "bytes/ray", "visits/batch");
  Json rows = Json::array();
  std::vector<float> picture;
  bool identical = true;
  for (const double share : {1.0, 0.5, 0.25, 0.1}) {
    for (const Order order : {Order::kQueued, Order::kDepthFirst}) {
      const Row row = run_row(arguments, scene, order, share);
      print_row(row);
      rows.push_back(row_json(row));
      if (picture.empty()) picture = row.result.rgba;
      identical = identical && picture == row.result.rgba;
    }
  }
  fmt::print("pictures: {}\n", identical ? "identical" : "DIFFERENT");
  if (!arguments.json.empty()) {
    const std::string text = rows.dump(1) + "\n";
    const Status written = write_whole_file(posix_file_system(), arguments.json, std::as_bytes(std::span(text)));
    if (!written.ok()) stop(written.error());
  }
  std::error_code code;
  std::filesystem::remove_all(folder, code);
  return identical ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app{"Queued against depth-first: time and traffic at several cache sizes", "order_traffic"};
  app.add_option("--triangles", arguments.triangles, "of the generated terrain")->capture_default_str();
  app.add_option("--scene", arguments.scene, "a .shoal instead of the terrain");
  app.add_option("--runs", arguments.runs, "runs a row")->capture_default_str()->check(CLI::Range(1, 100));
  app.add_option("--size", arguments.side, "pixels a side")->capture_default_str();
  app.add_option("--spp", arguments.samples, "samples a pixel")->capture_default_str();
  app.add_flag("--short", arguments.brief, "a small scene and one run, to see that it works");
  app.add_option("--json", arguments.json, "the rows as JSON");
  CLI11_PARSE(app, argc, argv);
  if (arguments.brief) arguments.triangles = 100'000, arguments.runs = 1, arguments.side = 32, arguments.samples = 1;
  return run(arguments);
}
