// bench/effects_price: what the effects plan saves. Every scene is rendered by its plan and with --effects all, in
// turns, and the pictures must be the same to the bit; scenes whose every surface is Lambert's also by a build from which
// everything else is compiled out. Times are the medians of the phases shading and paths, which are what effects
// change, and of the whole; bytes a path are those of rays, path states and treelets taken in hand. One thread.
//
//   bench/effects_price [--scenes DIR_OR_FILE ...] [--size PIXELS] [--spp N] [--runs N] [--order O] [--short] [--json F]
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include <CLI/CLI.hpp>

#include "bench/program_runs.h"

namespace {

using namespace shoal::bench;
namespace files = std::filesystem;

struct Way {
  const char* name;
  std::string program;
  std::vector<std::string> more;
  std::vector<double> seconds, shading_seconds;
  RenderRun last;
};

double phase_seconds(const RenderRun& run, std::initializer_list<const char*> phases) {
  double sum = 0;
  for (const char* phase : phases) sum += run.stats["phases"]["seconds"][phase].get<double>();
  return sum;
}

double bytes_a_path(const RenderRun& run) {
  const uint64_t bytes = run.total("ray_moved_bytes") + run.total("path_state_moved_bytes") +
                         run.total("treelet_visit_bytes") + run.total("disk_read_bytes");
  return static_cast<double>(bytes) / static_cast<double>(run.total("samples_committed_count"));
}

std::string effects_that_are_on(const RenderRun& run) {
  std::string names;
  for (const Json& effect : run.stats["effects"]) {
    if (effect["on"] != true) continue;
    names += (names.empty() ? "" : ", ") + effect["name"].get<std::string>();
  }
  return names;
}

/// Nothing but diffuse surfaces, emission, lights and instances.
bool is_plain(const RenderRun& run) {
  for (const Json& effect : run.stats["effects"]) {
    const std::string name = effect["name"];
    const bool plain = name == "emission" || name == "punctual-lights" || name == "instance-transforms" ||
                       name == "environment";
    if (effect["on"] == true && !plain) return false;
  }
  return true;
}

class Price {
 public:
  Price(const Setup& setup, std::string order, std::string only_lambert)
      : setup_(setup), order_(std::move(order)), only_lambert_(std::move(only_lambert)) {}

  /// False when a run failed or pictures differ.
  bool measure(const std::string& source) {
    setup_.scene = setup_.folder + "/scene.shoal";
    const std::vector<std::string> build{setup_.program, "build", source, "-o", setup_.scene, "--quiet"};
    if (const auto built = shoal::testing::run_measured(build, nullptr); built.exit_code != 0) {
      fmt::print("{:<34} not built (exit {})\n", files::path(source).filename().string(), built.exit_code);
      return true;  // it needs what Shoal refuses: said, and nothing to measure
    }
    std::vector<Way> ways{{"plan", setup_.program, {}, {}, {}, {}}, {"all", setup_.program, {"--effects", "all"}, {}, {}, {}}};
    if (!run(ways[0])) return failed(ways[0]);
    if (is_plain(ways[0].last)) ways.push_back({"only-lambert", only_lambert_, {}, {}, {}, {}});
    for (Way& way : ways) way.seconds.clear(), way.shading_seconds.clear();  // the first run read the file
    for (uint32_t turn = 0; turn < setup_.runs; ++turn) {
      for (Way& way : ways) {
        if (!run(way)) return failed(way);
        if (&way != &ways[0] && !same_picture(setup_, ways[0].last, way.last)) {
          fmt::print("{}: {} gives another picture\n", source, way.name);
          return false;
        }
      }
    }
    print(source, ways);
    return true;
  }
  const Json& rows() const { return rows_; }

 private:
  bool run(Way& way) {
    Setup setup = setup_;
    setup.program = way.program;
    RenderAsk ask;
    ask.order = order_;
    ask.more = {"--environment", "constant:1,1,1", "--buffered-reads"};
    ask.more.insert(ask.more.end(), way.more.begin(), way.more.end());
    way.last = run_render(setup, way.name, ask);
    if (!way.last.ok()) return false;
    way.seconds.push_back(way.last.seconds());
    way.shading_seconds.push_back(phase_seconds(way.last, {"shading", "paths"}));
    return true;
  }
  bool failed(const Way& way) {
    fmt::print("{} failed: {}\n", way.name, way.last.process.output);
    return false;
  }
  void print(const std::string& source, const std::vector<Way>& ways) {
    Json row{{"scene", source}, {"effects_on", effects_that_are_on(ways[0].last)}};
    const std::string name = files::path(source).filename().string();
    for (const Way& way : ways) {
      const double seconds = median(way.seconds), shading = median(way.shading_seconds), bytes = bytes_a_path(way.last);
      const double ratio = seconds / median(ways[0].seconds), shading_ratio = shading / median(ways[0].shading_seconds);
      fmt::print("{:<34} {:<13} {:>9.3f} {:>7.3f} {:>10.3f} {:>7.3f} {:>12.0f}\n", &way == &ways[0] ? name : "", way.name,
                 seconds, ratio, shading, shading_ratio, bytes);
      row[way.name] = {{"median_seconds", seconds}, {"seconds", way.seconds}, {"over_plan", ratio},
                       {"shading_seconds", shading}, {"shading_over_plan", shading_ratio}, {"bytes_a_path", bytes}};
    }
    rows_.push_back(std::move(row));
    std::fflush(stdout);
  }

  Setup setup_;
  std::string order_, only_lambert_;
  Json rows_ = Json::array();
};

std::vector<std::string> scene_files(const std::vector<std::string>& asked) {
  std::vector<std::string> found;
  for (const std::string& place : asked) {
    if (files::is_regular_file(place)) {
      found.push_back(place);
    } else {
      for (const auto& entry : files::recursive_directory_iterator(place)) {
        const std::string extension = entry.path().extension();
        if (extension == ".gltf" || extension == ".glb") found.push_back(entry.path());
      }
    }
  }
  std::sort(found.begin(), found.end());
  return found;
}

int measure_all(Setup setup, const std::string& order, const std::vector<std::string>& scenes, const std::string& json) {
  const std::string here = files::read_symlink("/proc/self/exe").parent_path();
  setup.program = here + "/shoal";
  setup.folder = (files::temp_directory_path() / fmt::format("shoal-effects-{}", ::getpid())).string();
  files::create_directories(setup.folder);
  std::vector<std::string> sources = scenes.empty() ? std::vector<std::string>{} : scene_files(scenes);
  if (scenes.empty()) {
    const std::vector<std::string> demo{setup.program, "generate", "demo", "--out", setup.folder + "/demo", "--quiet"};
    if (const auto made = shoal::testing::run_measured(demo, nullptr); made.exit_code != 0) give_up(made.output);
    sources = scene_files({setup.folder + "/demo"});
  }
  fmt::print("{} x {}, {} spp, {} bounces, {} threads, order {}, medians of {}\n", setup.width, setup.height,
             setup.samples, setup.bounces, setup.threads, order, setup.runs);
  fmt::print("{:<34} {:<13} {:>9} {:>7} {:>10} {:>7} {:>12}\n", "scene", "effects", "seconds", "ratio", "shading",
             "ratio", "bytes/path");
  Price price(setup, order, here + "/shoal_only_lambert");
  bool ok = !sources.empty();
  for (const std::string& source : sources) ok = price.measure(source) && ok;
  if (!json.empty()) std::ofstream(json) << price.rows().dump(1) << '\n';
  files::remove_all(setup.folder);
  return ok ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"What the effects plan saves against everything switched on, scene by scene"};
  Setup setup;
  setup.width = 256, setup.samples = 16, setup.threads = 1;
  std::string order = "depth-first", json;
  std::vector<std::string> scenes;
  bool brief = false;
  app.add_option("--scenes", scenes, "folders or glTF files (default: the demo)")->check(CLI::ExistingPath);
  app.add_option("--size", setup.width, "of the square picture, in pixels")->capture_default_str();
  app.add_option("--spp", setup.samples, "samples a pixel")->capture_default_str();
  app.add_option("--runs", setup.runs, "in turns; the median counts")->capture_default_str();
  app.add_option("--order", order, "of the rays")->capture_default_str();
  app.add_flag("--short", brief, "to see that it runs");
  app.add_option("--json", json, "file for the figures");
  CLI11_PARSE(app, argc, argv);
  if (brief) setup.width = 32, setup.samples = 1, setup.runs = 1;
  setup.height = setup.width;
  try {
    return measure_all(setup, order, scenes, json);
  } catch (const std::exception& error) {
    fmt::print(stderr, "effects_price: {}\n", error.what());
    return 1;
  }
}
