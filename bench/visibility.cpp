// bench/visibility: what does each pixel see? Asked of the BVH (depth-first, queued, hybrid), of a k-d tree and of
// a tiled rasteriser: the same triangles, rays and threads in one process. All give the same (t, triangle) for
// every pixel to the bit, or the exit code is 1. docs/measuring.md says what the columns mean.
//
//   bench/visibility [--scene F.shoal|F.gltf | --kind terrain|instances --triangles N] [--width N] [--height N]
//       [--threads N] [--builder sah|lbvh|karras] [--repeats N] [--folder DIR] [--short] [--json F]
#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <CLI/CLI.hpp>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "bench/given_scene.h"
#include "bench/kd_tree.h"
#include "bench/tiled_rasterizer.h"
#include "engine/camera.h"
#include "engine/clock.h"
#include "treelets/build_object.h"

namespace {

using namespace shoal;
using namespace shoal::bench;
namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr MemoryOrder kOrders[] = {MemoryOrder::kDepthFirst, MemoryOrder::kQueued, MemoryOrder::kHybrid};

struct Arguments {
  GivenScene scene;
  std::string folder = fs::temp_directory_path().string(), json, builder = "sah";
  uint32_t width = 1920, height = 1080;
  unsigned threads = std::max(1u, std::thread::hardware_concurrency());
  int repeats = 3;
  bool brief = false;
};

struct Spent {
  double seconds = 0, cpu_seconds = 0;  ///< the processor's: of all threads
};

/// What one way took, and whether it saw what the others did.
struct Row {
  std::string name;
  Spent build;
  uint64_t bytes = 0;
  std::vector<TeamSeconds> traces;
  uint64_t tests = 0;  ///< of rays and triangles; 0: not counted
  uint64_t different = 0;
  LargeVector<RayAnswer> answers;

  TeamSeconds median() const {
    std::vector<TeamSeconds> sorted = traces;
    std::sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.cpu < b.cpu; });
    return sorted[sorted.size() / 2];
  }
};

template <class F>
Spent timed(unsigned threads, const F& work) {
  tbb::task_arena arena(static_cast<int>(threads));
  const double start = now_seconds(), cpu = process_cpu_seconds();
  arena.execute(work);
  return {now_seconds() - start, process_cpu_seconds() - cpu};
}

class NoSink : public TreeletSink {
 public:
  Result<TreeletId> add(std::span<const std::byte>, std::span<const std::byte>) override { return next_++; }

 private:
  TreeletId next_ = 0;
};

/// Triangles in memory to packed treelets: what building took, as the k-d tree's time is taken. Triangles of
/// instances count once for each, as they do there.
Result<Spent> time_bvh(const VisibleTriangles& triangles, BvhBuilder builder, unsigned threads) {
  TriangleSoup soup;
  for (const VisibleTriangle& triangle : triangles.triangles) {
    Vec3 world[3];
    triangles.place(triangle, world);
    for (const Vec3& p : world) soup.positions.insert(soup.positions.end(), {p.x, p.y, p.z});
    soup.primitive.push_back(static_cast<uint32_t>(soup.primitive.size()));
    soup.material.push_back(0);
  }
  NoSink sink;
  Status status;
  const Spent spent = timed(threads, [&] {
    auto built = build_object(std::move(soup), {.builder = builder}, nullptr, sink);
    if (!built.ok()) status = std::move(built).error();
  });
  if (!status.ok()) return std::move(status).error();
  return spent;
}

TeamSeconds trace_kd(const KdTree& tree, const RaySet& set, unsigned threads, std::span<RayAnswer> answers,
                     uint64_t& tests) {
  std::atomic<uint64_t> next{0}, all_tests{0};
  const TeamSeconds seconds = run_together(threads, [&](unsigned) {
    KdCounts counts;
    for (uint64_t first; (first = next.fetch_add(kRaysPerGrab)) < set.rays.size();) {
      for (uint64_t i = first; i < std::min<uint64_t>(first + kRaysPerGrab, set.rays.size()); ++i) {
        Ray ray = begin_ray(set.rays[i], static_cast<uint32_t>(i), false);
        tree.trace(ray, counts);
        answers[i] = answer_of(ray);
      }
    }
    all_tests += counts.triangle_tests;
  });
  tests = all_tests;
  return seconds;
}

uint64_t count_different(const LargeVector<RayAnswer>& a, const LargeVector<RayAnswer>& b) {
  uint64_t different = 0;
  for (size_t i = 0; i < a.size(); ++i) different += std::memcmp(&a[i], &b[i], sizeof a[i]) != 0 ? 1 : 0;
  return different;
}

void print(const std::vector<Row>& rows) {
  fmt::print("{:<16} {:>9} {:>9} {:>10} {:>9} {:>9} {:>12} {:>9}\n", "", "build s", "cpu s", "MiB", "trace s",
             "cpu s", "tests a ray", "differ");
  for (const Row& row : rows) {
    const TeamSeconds trace = row.median();
    fmt::print("{:<16} {:>9.3f} {:>9.3f} {:>10.1f} {:>9.4f} {:>9.4f} {:>12.2f} {:>9}\n", row.name,
               row.build.seconds, row.build.cpu_seconds, static_cast<double>(row.bytes) / (1 << 20), trace.wall,
               trace.cpu, static_cast<double>(row.tests) / static_cast<double>(row.answers.size()), row.different);
  }
}

Json to_json(const Row& row) {
  const TeamSeconds trace = row.median();
  return {{"way", row.name},
          {"build_seconds", row.build.seconds},
          {"build_cpu_seconds", row.build.cpu_seconds},
          {"bytes", row.bytes},
          {"trace_seconds", trace.wall},
          {"trace_mean_thread_cpu_seconds", trace.cpu},
          {"triangle_tests_count", row.tests},
          {"different_pixels_count", row.different}};
}

/// All rows, in the order in which they are printed. The ways take turns.
Result<std::vector<Row>> measure(const Arguments& arguments, BvhBuilder builder, const MemoryScene& memory,
                                 const CameraRecord& camera, const FilmSamples& samples) {
  SHOAL_ASSIGN_OR_RETURN(const VisibleTriangles triangles, take_triangles(memory));
  RaySet set;
  set.name = "camera", set.coherent = true;
  set.rays = samples.rays;
  SHOAL_ASSIGN_OR_RETURN(const Spent bvh_build, time_bvh(triangles, builder, arguments.threads));
  std::vector<Row> rows;
  std::vector<std::function<TeamSeconds(Row&)>> ways;
  const auto add = [&](const std::string& name, const Spent& build, uint64_t bytes, auto way) {
    rows.push_back({name, build, bytes, {}, 0, 0, LargeVector<RayAnswer>(set.rays.size())});
    ways.emplace_back(std::move(way));
  };
  std::vector<std::unique_ptr<RayOrder>> orders;
  for (const MemoryOrder order : kOrders) {
    orders.push_back(make_order(order, memory, {.threads = arguments.threads}, set.rays.size()));
    add(fmt::format("bvh {}", name_of(order)), bvh_build,
        memory.geometry_bytes + memory.top_tree().resident_bytes(), [&set, order = orders.back().get()](Row& row) {
          const OrderRun run = order->run(set, row.answers);
          row.tests = run.counts.triangle_tests;
          return run.seconds;
        });
  }
  std::unique_ptr<KdTree> kd;
  const Spent kd_build = timed(arguments.threads, [&] { kd = std::make_unique<KdTree>(triangles); });
  const uint64_t triangle_bytes = triangles.triangles.size() * sizeof(VisibleTriangle);
  add("k-d tree", kd_build, kd->bytes() + triangle_bytes,
      [&](Row& row) { return trace_kd(*kd, set, arguments.threads, row.answers, row.tests); });
  std::unique_ptr<TiledRasterizer> raster;
  const Spent binning = timed(arguments.threads, [&] {
    raster = std::make_unique<TiledRasterizer>(triangles, camera, samples, arguments.threads);
  });
  add("tiled rasteriser", binning, raster->bytes() + triangle_bytes, [&](Row& row) {
    RasterCounts counts;
    const TeamSeconds seconds = raster->draw(row.answers, counts);
    row.tests = counts.candidates;
    return seconds;
  });
  for (int repeat = 0; repeat < arguments.repeats; ++repeat) {
    for (size_t i = 0; i < rows.size(); ++i) {
      std::fill(rows[i].answers.begin(), rows[i].answers.end(), RayAnswer{});
      rows[i].traces.push_back(ways[i](rows[i]));
    }
  }
  for (Row& row : rows) row.different = count_different(row.answers, rows[0].answers);
  return rows;
}

Status run(const Arguments& arguments) {
  const auto builder = find_bvh_builder(arguments.builder);
  if (!builder) return Error{ErrorCode::kUsage, "--builder: expected sah, lbvh or karras"};
  const WorkFolder folder(arguments.folder, "visibility");
  SceneBuildOptions build;
  build.builder = *builder;
  SHOAL_ASSIGN_OR_RETURN(const std::string path, scene_file(arguments.scene, folder, build));
  SHOAL_ASSIGN_OR_RETURN(const MemoryScene memory, load_into_memory(path));
  const CameraRecord camera =
      memory.scene.cameras.empty() ? frame_camera(memory.top_tree().bounds()) : memory.scene.cameras[0];
  SHOAL_ASSIGN_OR_RETURN(const FilmSamples samples, camera_samples(camera, arguments.width, arguments.height));
  SHOAL_ASSIGN_OR_RETURN(const std::vector<Row> rows, measure(arguments, *builder, memory, camera, samples));
  uint64_t hits = 0, different = 0;
  for (const RayAnswer& answer : rows[0].answers) hits += answer.primitive != kNoIndex ? 1 : 0;
  for (const Row& row : rows) different += row.different;
  fmt::print("{}: {:.2f} M triangles, {} x {} pixels, {:.1f} % of which see one; {} thread{}, median of {}\n",
             arguments.scene.name(), static_cast<double>(memory.scene.header.instanced_triangles_count) * 1e-6,
             arguments.width, arguments.height,
             100 * static_cast<double>(hits) / static_cast<double>(samples.rays.size()), arguments.threads,
             arguments.threads == 1 ? "" : "s", arguments.repeats);
  print(rows);
  if (!arguments.json.empty()) {
    Json json = {{"scene", arguments.scene.name()}, {"pixels_count", samples.rays.size()}, {"hits_count", hits}};
    for (const Row& row : rows) json["ways"].push_back(to_json(row));
    const std::string text = json.dump(1) + "\n";
    SHOAL_RETURN_IF_ERROR(write_whole_file(posix_file_system(), arguments.json, std::as_bytes(std::span(text))));
  }
  if (hits == 0) return Error{ErrorCode::kInput, "the camera sees nothing: nothing was compared"};
  if (different > 0) return Error{ErrorCode::kInternal, fmt::format("{} pixels see something else", different)};
  return {};
}

void add_options(CLI::App& app, Arguments& arguments) {
  auto* scene = app.add_option("--scene", arguments.scene.path, "a .shoal, or a .gltf that is built first");
  app.add_option("--kind", arguments.scene.kind, "of the generated scene: terrain or instances")
      ->excludes(scene)
      ->capture_default_str();
  app.add_option("--triangles", arguments.scene.triangles, "of the generated scene, such as 4M")
      ->transform(
          CLI::AsNumberWithUnit(std::map<std::string, uint64_t>{{"K", 1000}, {"M", 1000000}, {"G", 1000000000}}))
      ->excludes(scene)
      ->capture_default_str();
  app.add_option("--builder", arguments.builder, "of the BVH: sah, lbvh, karras; of a .shoal, as it is")
      ->capture_default_str();
  app.add_option("--width", arguments.width, "of the picture")->check(CLI::Range(1, 16384))->capture_default_str();
  app.add_option("--height", arguments.height, "of the picture")
      ->check(CLI::Range(1, 16384))
      ->capture_default_str();
  app.add_option("--threads", arguments.threads, "of every way")->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--repeats", arguments.repeats, "turns of each way")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  app.add_option("--folder", arguments.folder, "for what is generated and built")->capture_default_str();
  app.add_flag("--short", arguments.brief, "a small scene and picture, to see that it works");
  app.add_option("--json", arguments.json, "the figures as JSON");
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app{"What each pixel sees, by a BVH, a k-d tree and a rasteriser", "visibility"};
  add_options(app, arguments);
  CLI11_PARSE(app, argc, argv);
  if (arguments.brief) {
    arguments.scene.triangles = std::min<uint64_t>(arguments.scene.triangles, 50'000);
    arguments.width = 320, arguments.height = 180, arguments.repeats = 1;
  }
  const Status status = run(arguments);
  if (status.ok()) return 0;
  fmt::print(stderr, "visibility: {}\n", status.error().message);
  return static_cast<int>(status.error().code);
}
