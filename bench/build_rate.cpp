// bench/build_rate: million triangles a second from .gltf to .shoal under a cap smaller than the scene, beside Embree's
// medium-quality BVH of the same triangles in memory, with as many threads and on the same machine in the same minutes.
//
//   bench/build_rate [--triangles N] [--gltf F.gltf] [--cap BYTES] [--threads N] [--folder DIR] [--program SHOAL]
//       [--short] [--json F]
#include <embree3/rtcore.h>
#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>
#include <unistd.h>

#include <CLI/CLI.hpp>

#include "bench/load_triangles.h"
#include "bench/wide_bvh.h"
#include "engine/clock.h"
#include "engine/render_report.h"
#include "tests/support/memory_group.h"
#include "treelets/triangle_refs.h"

namespace {

using namespace shoal;
using namespace shoal::bench;
using Json = nlohmann::ordered_json;

/// Less cannot work, whatever the scene: program and buffers.
constexpr uint64_t kLeastCapBytes = 64ull << 20;

struct Arguments {
  uint64_t triangles = 40'000'000, cap_bytes = 0;
  std::string gltf, folder = std::filesystem::temp_directory_path().string(), json, program;
  unsigned threads = std::max(1u, std::thread::hardware_concurrency());
  bool brief = false;
};

[[noreturn]] void stop(const Error& error) {
  fmt::print(stderr, "build_rate: {}\n", error.message);
  std::exit(static_cast<int>(error.code));
}

template <class T>
T value_or_stop(Result<T> result) {
  if (!result.ok()) stop(result.error());
  return std::move(result).value();
}

struct EmbreeSeconds {
  double bvh = 0;    ///< rtcBuildBVH: the builder alone, from boxes to nodes, branching 8, leaves of at most 8
  double scene = 0;  ///< rtcCommitScene: what a renderer that uses Embree waits for
};

double build_scene_seconds(RTCDevice device, const Triangles& triangles) {
  RTCScene scene = rtcNewScene(device);
  rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_MEDIUM);
  RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetGeometryBuildQuality(mesh, RTC_BUILD_QUALITY_MEDIUM);
  rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, triangles.vertices.data(), 0, 12,
                             triangles.vertices.size() / 3);
  rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, triangles.indices.data(), 0, 12,
                             triangles.count());
  const double start = now_seconds();
  rtcCommitGeometry(mesh);
  rtcAttachGeometry(scene, mesh);
  rtcReleaseGeometry(mesh);
  rtcCommitScene(scene);
  const double seconds = now_seconds() - start;
  rtcReleaseScene(scene);
  return seconds;
}

EmbreeSeconds build_with_embree(const Triangles& triangles, unsigned threads) {
  RTCDevice device = rtcNewDevice(fmt::format("threads={},set_affinity=0", threads).c_str());
  EmbreeSeconds seconds;
  seconds.scene = build_scene_seconds(device, triangles);
  const RefArray refs = make_refs(corner_positions(triangles));
  seconds.bvh = EmbreeBvh(device, primitives_of(refs.refs()), refs.size(), {8, 1}).spent().seconds;
  rtcReleaseDevice(device);
  return seconds;
}

uint64_t bytes_of_folder(const std::filesystem::path& folder) {
  uint64_t sum = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.is_regular_file()) sum += entry.file_size();
  }
  return sum;
}

int run(const Arguments& arguments) {
  const std::filesystem::path folder = arguments.folder + fmt::format("/shoal-build-rate-{}", ::getpid());
  const std::string gltf =
      arguments.gltf.empty() ? value_or_stop(generate_terrain(folder / "scene", arguments.triangles)) : arguments.gltf;
  std::filesystem::create_directories(folder);
  const uint64_t input_bytes = bytes_of_folder(std::filesystem::path(gltf).parent_path());
  const uint64_t cap = arguments.cap_bytes > 0 ? arguments.cap_bytes : std::max(input_bytes / 4, kLeastCapBytes);
  const std::string output = (folder / "built.shoal").string();
  // A process of its own, so that its peak of memory is its own.
  const testing::MeasuredRun built = testing::run_measured(
      {arguments.program, "build", gltf, "-o", output, "--quiet", "--threads", std::to_string(arguments.threads),
       "--max-memory", std::to_string(cap)});
  if (built.exit_code != 0) fmt::print(stderr, "build_rate: shoal build failed: {}\n", built.output);
  std::error_code code;
  const uint64_t output_bytes = built.exit_code == 0 ? std::filesystem::file_size(output, code) : 0;
  std::filesystem::remove(output, code);
  const Triangles triangles = value_or_stop(read_triangles(gltf));
  const EmbreeSeconds embree = build_with_embree(triangles, arguments.threads);
  std::filesystem::remove_all(folder, code);
  if (built.exit_code != 0) return built.exit_code;

  const double millions = static_cast<double>(triangles.count()) * 1e-6;
  fmt::print("{}: {:.2f} M triangles, {} of source; {} threads\n", gltf, millions, format_bytes(input_bytes),
             arguments.threads);
  fmt::print("{:<28} {:>9} {:>14} {:>12} {:>10}\n", "", "seconds", "M triangles/s", "cap", "peak RSS");
  fmt::print("{:<28} {:>9.2f} {:>14.3f} {:>12} {:>10}\n", "shoal build, .gltf to .shoal", built.seconds,
             millions / built.seconds, format_bytes(cap), format_bytes(built.peak_rss_bytes));
  fmt::print("{:<28} {:>9.2f} {:>14.3f}\n", "Embree rtcBuildBVH, medium", embree.bvh, millions / embree.bvh);
  fmt::print("{:<28} {:>9.2f} {:>14.3f}\n", "Embree rtcCommitScene", embree.scene, millions / embree.scene);
  fmt::print("rate over Embree's: {:.3f} of rtcBuildBVH, {:.3f} of rtcCommitScene\n", embree.bvh / built.seconds,
             embree.scene / built.seconds);
  if (arguments.json.empty()) return 0;
  const Json json = {{"triangles_count", triangles.count()},    {"source_bytes", input_bytes},
                     {"output_bytes", output_bytes},            {"threads_count", arguments.threads},
                     {"cap_bytes", cap},                        {"build_seconds", built.seconds},
                     {"build_peak_rss_bytes", built.peak_rss_bytes},
                     {"build_disk_read_bytes", built.disk_read_bytes},
                     {"build_disk_write_bytes", built.disk_write_bytes},
                     {"embree_bvh_seconds", embree.bvh},        {"embree_scene_seconds", embree.scene}};
  const std::string text = json.dump(1) + "\n";
  const Status written = write_whole_file(posix_file_system(), arguments.json, std::as_bytes(std::span(text)));
  if (!written.ok()) stop(written.error());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  arguments.program = (std::filesystem::read_symlink("/proc/self/exe").parent_path() / "shoal").string();
  CLI::App app{"Building: triangles a second under a cap, beside Embree in memory", "build_rate"};
  app.add_option("--triangles", arguments.triangles, "of the generated terrain, such as 100M")
      ->transform(CLI::AsNumberWithUnit(
          std::map<std::string, uint64_t>{{"K", 1000}, {"M", 1000000}, {"G", 1000000000}}))
      ->capture_default_str();
  app.add_option("--gltf", arguments.gltf, "built in place of the terrain");
  app.add_option("--cap", arguments.cap_bytes, "such as 512M (default: a quarter of the source, at least 64M)")
      ->transform(CLI::AsSizeValue(false));
  app.add_option("--threads", arguments.threads, "of both")->capture_default_str();
  app.add_option("--folder", arguments.folder, "for source and output")->capture_default_str();
  app.add_option("--program", arguments.program, "the shoal that is measured")->capture_default_str();
  app.add_flag("--short", arguments.brief, "a small scene without a cap that matters, to see that it works");
  app.add_option("--json", arguments.json, "the figures as JSON");
  CLI11_PARSE(app, argc, argv);
  if (arguments.brief) arguments.triangles = 50'000, arguments.cap_bytes = 1ull << 30;
  return run(arguments);
}
