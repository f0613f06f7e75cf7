// bench/against_embree: how fast rays are traced against a scene that fits in memory, beside Embree: the same
// triangles, rays and threads, in one process. docs/measuring.md says what the columns mean.
//
//   bench/against_embree [--scene F.shoal|F.gltf | --triangles N] [--rays N] [--workloads a,b] [--threads 1,2]
//       [--repeats N] [--in-flight N] [--queue sweep|fullest] [--not-robust] [--cpu-time] [--folder DIR] [--short]
//       [--json F]
#include <fmt/format.h>

#include <filesystem>
#include <thread>

#include <CLI/CLI.hpp>

#include "bench/given_scene.h"
#include "bench/ray_workloads.h"
#include "bench/rival_report.h"

namespace {

using namespace shoal;
using namespace shoal::bench;
namespace fs = std::filesystem;

/// As many rays disagree at most, or the comparison is not one.
constexpr double kMostDisagreeing = 1e-3;
constexpr uint64_t kLeastRays = 100'000, kMostRays = 4'000'000;

struct Arguments {
  GivenScene scene;
  std::string folder = fs::temp_directory_path().string(), json;
  uint64_t rays = 0;
  std::vector<std::string> workloads{std::begin(kWorkloads), std::end(kWorkloads)};
  std::vector<unsigned> threads{1, 2};
  MeasureOptions measure;
  bool not_robust = false, brief = false;
};

RivalScene describe(const Arguments& arguments, const MemoryScene& memory, const WorldMesh& mesh,
                    const EmbreeScene& usual, const EmbreeScene& compact) {
  RivalScene scene;
  scene.name = arguments.scene.name();
  scene.triangles = mesh.triangle_count();
  scene.treelets = memory.pages.size();
  scene.shoal_bytes = memory.geometry_bytes + memory.top_tree().resident_bytes();
  scene.mesh_bytes = mesh.bytes();
  scene.embree_default_bytes = usual.bytes(), scene.embree_compact_bytes = compact.bytes();
  scene.embree_default_seconds = usual.build_seconds(), scene.embree_compact_seconds = compact.build_seconds();
  scene.robust = !arguments.not_robust, scene.cpu_time = arguments.measure.cpu_time;
  return scene;
}

Status check_row(const RivalRow& row) {
  if (row.orders_disagreeing > 0) {
    return Error{ErrorCode::kInternal, fmt::format("{}: {} of {} rays have another answer in another order",
                                                   row.workload, row.orders_disagreeing, row.rays)};
  }
  if (static_cast<double>(row.disagreeing) > kMostDisagreeing * static_cast<double>(row.rays)) {
    return Error{ErrorCode::kInternal, fmt::format("{}: {} of {} rays have another hit in Embree: more than {:g} %",
                                                   row.workload, row.disagreeing, row.rays, 100 * kMostDisagreeing)};
  }
  return {};
}

Status run(const Arguments& arguments) {
  const WorkFolder folder(arguments.folder, "against-embree");
  SHOAL_ASSIGN_OR_RETURN(const std::string path, scene_file(arguments.scene, folder));
  SHOAL_ASSIGN_OR_RETURN(const MemoryScene memory, load_into_memory(path));
  SHOAL_ASSIGN_OR_RETURN(const WorldMesh mesh, take_mesh(memory));
  EmbreeOptions options;
  options.robust = !arguments.not_robust;
  options.build_threads = std::max(1u, std::thread::hardware_concurrency());
  const EmbreeScene usual(mesh, options);
  options.compact = true;
  const EmbreeScene compact(mesh, options);
  const RivalScene scene = describe(arguments, memory, mesh, usual, compact);
  print_scene(scene);
  print_header();

  const uint64_t usual_rays = std::clamp(mesh.triangle_count() / 10, kLeastRays, kMostRays);
  RayWorkloads workloads(memory, mesh, arguments.rays > 0 ? arguments.rays : usual_rays, options.build_threads);
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  Status agreed;
  for (const std::string& name : arguments.workloads) {
    SHOAL_ASSIGN_OR_RETURN(const RaySet set, workloads.make(name));
    for (const unsigned threads : arguments.threads) {
      MeasureOptions measure = arguments.measure;
      measure.order.threads = threads;
      const RivalRow row = measure_rivals(memory, usual, compact, set, measure);
      print_row(row);
      rows.push_back(to_json(scene, row));
      if (agreed.ok()) agreed = check_row(row);
    }
  }
  if (!arguments.json.empty()) {
    const std::string text = rows.dump(1) + "\n";
    SHOAL_RETURN_IF_ERROR(
        write_whole_file(posix_file_system(), arguments.json, std::as_bytes(std::span(text))));
  }
  return agreed;
}

void add_options(CLI::App& app, Arguments& arguments) {
  const CLI::AsNumberWithUnit thousands(
      std::map<std::string, uint64_t>{{"K", 1000}, {"M", 1000000}, {"G", 1000000000}});
  auto* scene = app.add_option("--scene", arguments.scene.path, "a .shoal, or a .gltf that is built first");
  app.add_option("--triangles", arguments.scene.triangles, "of the generated terrain, such as 40M")
      ->transform(thousands)
      ->excludes(scene)
      ->capture_default_str();
  app.add_option("--rays", arguments.rays, "a workload (default: a tenth of the triangles, 100K to 4M)")
      ->transform(thousands)
      ->check(CLI::Range(1000, 200'000'000));
  app.add_option("--workloads", arguments.workloads, "which, with commas between")
      ->delimiter(',')
      ->check(CLI::IsMember(std::vector<std::string>(std::begin(kWorkloads), std::end(kWorkloads))))
      ->capture_default_str();
  app.add_option("--threads", arguments.threads, "numbers of threads, with commas between")
      ->delimiter(',')
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  app.add_option("--repeats", arguments.measure.repeats, "turns of each program; the median counts")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  app.add_option("--in-flight", arguments.measure.order.in_flight, "rays in queues at once, such as 1M")
      ->transform(thousands)
      ->capture_default_str();
  app.add_option("--queue", arguments.measure.order.choice, "which treelet is drained next: sweep or fullest")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, QueueChoice>{{"sweep", QueueChoice::kSweep}, {"fullest", QueueChoice::kFullest}}));
  app.add_flag("--not-robust", arguments.not_robust, "Embree without its robust flag; ours stays watertight");
  app.add_flag("--cpu-time", arguments.measure.cpu_time, "mean of the threads, where others use the machine too");
  app.add_option("--folder", arguments.folder, "for what is generated and built")->capture_default_str();
  app.add_flag("--short", arguments.brief, "a small scene and few rays, to see that it works");
  app.add_option("--json", arguments.json, "the figures as JSON");
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app{"Rays a second against a scene in memory, beside Embree", "against_embree"};
  add_options(app, arguments);
  CLI11_PARSE(app, argc, argv);
  if (arguments.brief) arguments.scene.triangles = 50'000, arguments.rays = 20'000, arguments.measure.repeats = 1;
  const Status status = run(arguments);
  if (status.ok()) return 0;
  fmt::print(stderr, "against_embree: {}\n", status.error().message);
  return static_cast<int>(status.error().code);
}
