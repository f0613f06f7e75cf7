// bench/bvh_builders: the builders of `shoal build --builder` beside each other on one scene: what building takes,
// what the file and its tree cost, and how fast rays are traced in memory, depth-first and by the hybrid order. The
// answers of all rays must be those of the first builder to the bit, or the exit code is 1. docs/measuring.md says
// what the columns mean.
//
//   bench/bvh_builders [--gltf F.gltf | --triangles N] [--builders sah,lbvh,karras] [--rays N] [--threads N]
//       [--repeats N] [--folder DIR] [--short] [--json F]
#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <CLI/CLI.hpp>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "bench/given_scene.h"
#include "bench/ray_workloads.h"
#include "engine/clock.h"
#include "engine/generate.h"
#include "treelets/build_object.h"
#include "treelets/bvh_builder.h"
#include "treelets/treelet_layout.h"
#include "treelets/triangle_refs.h"

namespace {

using namespace shoal;
using namespace shoal::bench;
namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr MemoryOrder kOrders[] = {MemoryOrder::kDepthFirst, MemoryOrder::kHybrid};
constexpr const char* kTraced[] = {"primary", "diffuse"};

struct Arguments {
  GivenScene scene;
  std::string folder = fs::temp_directory_path().string(), json;
  std::vector<std::string> builders{"sah", "lbvh", "karras"};
  uint64_t rays = 1'000'000;
  unsigned threads = std::max(1u, std::thread::hardware_concurrency());
  int repeats = 3;
  bool brief = false;
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// Rays of one kind through one order.
struct TraceRow {
  std::vector<double> cpu_seconds;  ///< mean of the threads
  TraceCounts counts;
  LargeVector<RayAnswer> answers;
};

struct Row {
  std::string name;
  double build_seconds = 0, build_cpu_seconds = 0;  ///< `shoal build`'s: glTF to file
  std::vector<double> tree_cpu_seconds;             ///< references to the binary tree alone
  double sah_cost = 0;
  uint64_t geometry_bytes = 0, treelets = 0;
  MemoryScene memory;
  TraceRow traces[std::size(kTraced)][std::size(kOrders)];
};

Result<Row> build(const std::string& gltf, const std::string& name, const WorkFolder& folder, unsigned threads) {
  const auto builder = find_bvh_builder(name);
  if (!builder) return Error{ErrorCode::kUsage, "--builders: expected sah, lbvh and karras, found " + name};
  SceneBuildOptions options;
  options.builder = *builder;
  options.threads = threads;
  folder.make();
  const std::string path = folder / (name + ".shoal");
  Row row;
  row.name = name;
  const double cpu = process_cpu_seconds();
  SHOAL_ASSIGN_OR_RETURN(const SceneBuildReport report, build_scene(posix_file_system(), gltf, path, options));
  row.build_cpu_seconds = process_cpu_seconds() - cpu;
  row.build_seconds = report.seconds, row.sah_cost = report.sah_cost;
  row.geometry_bytes = report.geometry_bytes, row.treelets = report.treelets_count;
  SHOAL_ASSIGN_OR_RETURN(row.memory, load_into_memory(path));
  return row;
}

/// The tree alone, over all triangles in the world at once.
void time_trees(const Arguments& arguments, const WorldMesh& mesh, std::vector<Row>& rows) {
  std::vector<float> positions;
  positions.reserve(9 * mesh.triangle_count());
  for (uint64_t i = 0; i < mesh.triangle_count(); ++i) {
    for (uint32_t corner = 0; corner < 3; ++corner) {
      const Vec3 p = mesh.position(i, corner);
      positions.insert(positions.end(), {p.x, p.y, p.z});
    }
  }
  tbb::task_arena arena(static_cast<int>(arguments.threads));
  for (int repeat = 0; repeat < arguments.repeats; ++repeat) {
    for (Row& row : rows) {
      arena.execute([&] {
        const RefArray refs = make_refs(positions);
        const double start = process_cpu_seconds();
        const auto tree = build_tree(*find_bvh_builder(row.name), refs.refs(), {kMaxLeafTriangles});
        row.tree_cpu_seconds.push_back(process_cpu_seconds() - start);
      });
    }
  }
}

Status trace(const Arguments& arguments, const WorldMesh& mesh, std::vector<Row>& rows) {
  RayWorkloads workloads(rows[0].memory, mesh, arguments.rays, arguments.threads);
  for (size_t w = 0; w < std::size(kTraced); ++w) {
    SHOAL_ASSIGN_OR_RETURN(const RaySet set, workloads.make(kTraced[w]));
    for (int repeat = 0; repeat < arguments.repeats; ++repeat) {
      for (Row& row : rows) {
        for (size_t o = 0; o < std::size(kOrders); ++o) {
          TraceRow& traced = row.traces[w][o];
          traced.answers.resize(set.rays.size());
          const OrderRun run = make_order(kOrders[o], row.memory, {.threads = arguments.threads}, set.rays.size())
                                   ->run(set, traced.answers);
          traced.cpu_seconds.push_back(run.seconds.cpu);
          traced.counts = run.counts;
        }
      }
    }
    for (const Row& row : rows) {
      for (const TraceRow& traced : row.traces[w]) {
        if (std::memcmp(traced.answers.data(), rows[0].traces[w][0].answers.data(),
                        traced.answers.size() * sizeof(RayAnswer)) == 0) {
          continue;
        }
        return Error{ErrorCode::kInternal,
                     fmt::format("{}: some {} rays have another answer", row.name, kTraced[w])};
      }
    }
  }
  return {};
}

void print(const std::vector<Row>& rows) {
  fmt::print("{:<8} {:>8} {:>8} {:>8} {:>9} {:>7} {:>9}", "", "build s", "cpu s", "tree cpu", "SAH cost", "B/tri",
             "treelets");
  for (const char* kind : kTraced)
    fmt::print("   {:>8}: {:>8} {:>8} {:>7} {:>7}", kind, "d-f s", "hybrid", "nodes", "tests");
  fmt::print("\n");
  for (const Row& row : rows) {
    const auto triangles = static_cast<double>(row.memory.scene.header.triangles_count);
    fmt::print("{:<8} {:>8.2f} {:>8.2f} {:>8.2f} {:>9.2f} {:>7.2f} {:>9}", row.name, row.build_seconds,
               row.build_cpu_seconds, median(row.tree_cpu_seconds), row.sah_cost,
               static_cast<double>(row.geometry_bytes) / triangles, row.treelets);
    for (const auto& of_kind : row.traces) {
      const auto rays = static_cast<double>(of_kind[0].answers.size());
      fmt::print("   {:>8}  {:>8.3f} {:>8.3f} {:>7.2f} {:>7.2f}", "", median(of_kind[0].cpu_seconds),
                 median(of_kind[1].cpu_seconds), static_cast<double>(of_kind[0].counts.node_tests) / rays,
                 static_cast<double>(of_kind[0].counts.triangle_tests) / rays);
    }
    fmt::print("\n");
  }
}

Json to_json(const Row& row) {
  Json json = {{"builder", row.name},
               {"build_seconds", row.build_seconds},
               {"build_cpu_seconds", row.build_cpu_seconds},
               {"tree_cpu_seconds", row.tree_cpu_seconds},
               {"sah_cost", row.sah_cost},
               {"geometry_bytes", row.geometry_bytes},
               {"treelets_count", row.treelets}};
  for (size_t w = 0; w < std::size(kTraced); ++w) {
    for (size_t o = 0; o < std::size(kOrders); ++o) {
      const TraceRow& traced = row.traces[w][o];
      json[kTraced[w]][name_of(kOrders[o])] = {{"mean_thread_cpu_seconds", traced.cpu_seconds},
                                               {"rays_count", traced.answers.size()},
                                               {"node_tests_count", traced.counts.node_tests},
                                               {"triangle_tests_count", traced.counts.triangle_tests}};
    }
  }
  return json;
}

Result<std::string> source(const Arguments& arguments, const WorkFolder& folder) {
  if (!arguments.scene.path.empty()) return arguments.scene.path;
  GenerateOptions options;
  options.kind = arguments.scene.kind;
  options.triangles = arguments.scene.triangles;
  options.out_dir = folder / "source";
  SHOAL_ASSIGN_OR_RETURN(const GenerateReport generated, generate_scene(posix_file_system(), options));
  return generated.gltf_path;
}

Status run(const Arguments& arguments) {
  const WorkFolder folder(arguments.folder, "bvh-builders");
  SHOAL_ASSIGN_OR_RETURN(const std::string gltf, source(arguments, folder));
  std::vector<Row> rows;
  for (const std::string& name : arguments.builders) {
    SHOAL_ASSIGN_OR_RETURN(Row row, build(gltf, name, folder, arguments.threads));
    rows.push_back(std::move(row));
  }
  SHOAL_ASSIGN_OR_RETURN(const WorldMesh mesh, take_mesh(rows[0].memory));
  time_trees(arguments, mesh, rows);
  SHOAL_RETURN_IF_ERROR(trace(arguments, mesh, rows));
  fmt::print(
      "{}: {:.2f} M triangles, {} rays, {} thread{}; tree and rays: median of {}, seconds of rays: mean of the "
      "threads'\n",
      arguments.scene.name(), static_cast<double>(mesh.triangle_count()) * 1e-6, arguments.rays, arguments.threads,
      arguments.threads == 1 ? "" : "s", arguments.repeats);
  print(rows);
  if (arguments.json.empty()) return {};
  Json json = {{"scene", arguments.scene.name()}, {"triangles_count", mesh.triangle_count()}};
  for (const Row& row : rows) json["builders"].push_back(to_json(row));
  const std::string text = json.dump(1) + "\n";
  return write_whole_file(posix_file_system(), arguments.json, std::as_bytes(std::span(text)));
}

void add_options(CLI::App& app, Arguments& arguments) {
  const CLI::AsNumberWithUnit thousands(
      std::map<std::string, uint64_t>{{"K", 1000}, {"M", 1000000}, {"G", 1000000000}});
  auto* gltf = app.add_option("--gltf", arguments.scene.path, "built in place of the terrain");
  app.add_option("--triangles", arguments.scene.triangles, "of the generated terrain, such as 4M")
      ->transform(thousands)
      ->excludes(gltf)
      ->capture_default_str();
  app.add_option("--builders", arguments.builders, "which, with commas between")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--rays", arguments.rays, "of each kind")
      ->transform(thousands)
      ->check(CLI::Range(1000, 200'000'000))
      ->capture_default_str();
  app.add_option("--threads", arguments.threads, "of everything")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  app.add_option("--repeats", arguments.repeats, "turns of each builder")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  app.add_option("--folder", arguments.folder, "for what is generated and built")->capture_default_str();
  app.add_flag("--short", arguments.brief, "a small scene and few rays, to see that it works");
  app.add_option("--json", arguments.json, "the figures as JSON");
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app{"The builders of BVHs beside each other", "bvh_builders"};
  add_options(app, arguments);
  CLI11_PARSE(app, argc, argv);
  if (arguments.brief) arguments.scene.triangles = 50'000, arguments.rays = 20'000, arguments.repeats = 1;
  const Status status = run(arguments);
  if (status.ok()) return 0;
  fmt::print(stderr, "bvh_builders: {}\n", status.error().message);
  return static_cast<int>(status.error().code);
}
