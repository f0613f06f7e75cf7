// bench/many_lights: what a picture costs by the number of its lights. One hall, lit by 10 to 10,000 lights of the same
// power altogether; the error of the picture against one of many more samples, and the time of a sample. As the error
// falls with one over the number of samples, their product is the time to any error, and its ratio to that of the first
// row is what this prints. Beside the tree over the lights, the choice by power alone. Warm: every page is in memory.
//
//   bench/many_lights [--lights 10,100,1000,10000] [--size PIXELS] [--spp N] [--reference-spp N] [--runs N]
//                     [--threads N] [--folder DIR] [--short] [--json F]
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include <CLI/CLI.hpp>

#include "bench/light_scene.h"
#include "engine/build_scene.h"
#include "engine/render.h"

namespace {

using namespace shoal;
using Json = nlohmann::ordered_json;

struct Arguments {
  std::vector<uint32_t> lights{10, 100, 1000, 10000};
  uint32_t side = 96, samples = 32, reference_samples = 4096, bounces = 2;
  unsigned threads = 1;
  int runs = 3;
  std::string folder, json;
  bool brief = false;
};

[[noreturn]] void stop(const Error& error) {
  fmt::print(stderr, "many_lights: {}\n", error.message);
  std::exit(static_cast<int>(error.code));
}

template <class T>
T value_or_stop(Result<T> result) {
  if (!result.ok()) stop(result.error());
  return std::move(result).value();
}

struct Measured {
  std::vector<double> seconds;  ///< of each run, sorted
  double error = 0;             ///< relMSE: mean over pixels and channels of (x - r)^2 / (r^2 + 0.01 mean(r)^2)
  double mean = 0;              ///< of the picture

  double median() const { return seconds[seconds.size() / 2]; }
};

double relative_error(const std::vector<float>& picture, const std::vector<float>& reference) {
  double mean = 0, sum = 0;
  size_t count = 0;
  for (size_t i = 0; i < reference.size(); ++i) {
    if (i % 4 != 3) mean += reference[i], ++count;
  }
  mean /= static_cast<double>(count);
  for (size_t i = 0; i < reference.size(); ++i) {
    if (i % 4 == 3) continue;
    const double difference = double{picture[i]} - reference[i];
    sum += difference * difference / (double{reference[i]} * reference[i] + 0.01 * mean * mean);
  }
  return sum / static_cast<double>(count);
}

RenderResult rendered(const Arguments& arguments, const Scene& scene, LightChoice choice, uint32_t samples,
                      uint64_t seed) {
  PictureOptions picture;
  picture.width = picture.height = arguments.side;
  picture.samples = samples;
  picture.shading.bounces = arguments.bounces;
  picture.shading.seed = seed;
  picture.shading.light_choice = choice;
  ExecutionOptions execution;
  execution.order = Order::kHybrid;
  execution.threads = arguments.threads;
  return value_or_stop(render(posix_file_system(), scene, picture, execution));
}

Measured measure(const Arguments& arguments, const Scene& scene, LightChoice choice,
                 const std::vector<float>& reference) {
  Measured m;
  for (int run = 0; run < arguments.runs; ++run) {
    const RenderResult result = rendered(arguments, scene, choice, arguments.samples, static_cast<uint64_t>(run) + 1);
    m.seconds.push_back(result.seconds);
    m.error += relative_error(result.rgba, reference) / arguments.runs;
    for (size_t i = 0; i < result.rgba.size(); i += 4) m.mean += result.rgba[i] + result.rgba[i + 1] + result.rgba[i + 2];
  }
  m.mean /= 3.0 * arguments.side * arguments.side * arguments.runs;
  std::sort(m.seconds.begin(), m.seconds.end());
  return m;
}

int run(const Arguments& arguments) {
  const std::filesystem::path folder =
      arguments.folder.empty() ? std::filesystem::temp_directory_path() / fmt::format("shoal-bench-{}", ::getpid())
                               : std::filesystem::path(arguments.folder);
  fmt::print("{} x {}, {} spp against {}, {} bounces, {} threads, median of {} runs\n", arguments.side, arguments.side,
             arguments.samples, arguments.reference_samples, arguments.bounces, arguments.threads, arguments.runs);
  fmt::print("{:>8} {:<6} {:>10} {:>10} {:>24} {:>12} {:>10}\n", "lights", "by", "mean", "relMSE",
             "seconds (median, range)", "time to err.", "ratio");
  Json rows = Json::array();
  double first = 0;
  for (const uint32_t lights : arguments.lights) {
    const std::filesystem::path at = folder / std::to_string(lights);
    std::filesystem::create_directories(at);
    const std::string gltf = value_or_stop(bench::write_light_scene(at.string(), lights));
    const std::string shoal = (at / "lights.shoal").string();
    value_or_stop(build_scene(posix_file_system(), gltf, shoal, {}));
    const Scene scene = value_or_stop(open_scene(posix_file_system(), shoal, ReadMode::kBuffered, {}));
    const std::vector<float> reference =
        rendered(arguments, scene, LightChoice::kTree, arguments.reference_samples, 1000).rgba;
    for (const LightChoice choice : {LightChoice::kTree, LightChoice::kPower}) {
      const Measured m = measure(arguments, scene, choice, reference);
      const double time = m.error * m.median();
      if (first == 0) first = time;
      const char* name = choice == LightChoice::kTree ? "tree" : "power";
      fmt::print("{:>8} {:<6} {:>10.5f} {:>10.5f} {:>10.3f} [{:.3f}, {:.3f}] {:>12.5f} {:>10.2f}\n", lights, name,
                 m.mean, m.error, m.median(), m.seconds.front(), m.seconds.back(), time, time / first);
      std::fflush(stdout);
      rows.push_back({{"lights", lights},
                      {"light_choice", name},
                      {"mean", m.mean},
                      {"relative_mse", m.error},
                      {"seconds", m.seconds},
                      {"median_seconds", m.median()},
                      {"time_to_error", time},
                      {"ratio_to_first", time / first}});
    }
  }
  if (!arguments.json.empty()) {
    const std::string text = rows.dump(1) + "\n";
    const Status written = write_whole_file(posix_file_system(), arguments.json, std::as_bytes(std::span(text)));
    if (!written.ok()) stop(written.error());
  }
  std::error_code code;
  if (arguments.folder.empty()) std::filesystem::remove_all(folder, code);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app("What a picture costs by the number of its lights.");
  app.add_option("--lights", arguments.lights, "numbers of lights")->delimiter(',')->capture_default_str();
  app.add_option("--size", arguments.side, "pixels a side")->capture_default_str();
  app.add_option("--spp", arguments.samples, "samples a pixel that are measured")->capture_default_str();
  app.add_option("--reference-spp", arguments.reference_samples, "samples a pixel of the reference")
      ->capture_default_str();
  app.add_option("--bounces", arguments.bounces, "scattering events of a path at most")->capture_default_str();
  app.add_option("--threads", arguments.threads, "threads")->check(CLI::Range(1, 4096))->capture_default_str();
  app.add_option("--runs", arguments.runs, "runs, each with a seed of its own")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--folder", arguments.folder, "where the scenes go and stay (default: a folder that is removed)");
  app.add_option("--json", arguments.json, "where the rows go as JSON");
  app.add_flag("--short", arguments.brief, "a few seconds; the figures mean nothing");
  CLI11_PARSE(app, argc, argv);
  if (arguments.brief) {
    arguments.lights = {3, 300}, arguments.side = 16, arguments.samples = 2, arguments.reference_samples = 8;
    arguments.runs = 1;
  }
  return run(arguments);
}
