// bench/build_bvh: our in-memory stage of building beside Embree's rtcBuildBVH of the same references, on as many
// threads, turn by turn. Ours: references to the binary tree, which of its nodes become nodes of 8 children, and those
// written; treelets are cut and packed after that. Embree's: medium quality, branching 8, the same largest leaf. Both
// write the same nodes (bench/wide_bvh); making references from triangles is the same work for both and stands on a line
// of its own. Exit code 1: our trees cost more than 1.05 of Embree's by the surface-area heuristic.
//
//   bench/build_bvh [--triangles N] [--gltf F.gltf] [--threads 1,2] [--blocks 1,8] [--repeats N] [--folder DIR]
//       [--short] [--json F]
#include <embree3/rtcore.h>
#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include <CLI/CLI.hpp>

#include "bench/load_triangles.h"
#include "bench/wide_bvh.h"
#include "engine/clock.h"
#include "io/file.h"
#include "treelets/treelet_layout.h"
#include "treelets/triangle_refs.h"

namespace {

using namespace shoal;
using namespace shoal::bench;
using Json = nlohmann::ordered_json;

constexpr double kMostCost = 1.05;  ///< over Embree's: a faster builder of worse trees is no builder

struct Arguments {
  uint64_t triangles = 1'000'000;
  std::string gltf, folder = std::filesystem::temp_directory_path().string(), json;
  std::vector<unsigned> threads{1, 2};
  std::vector<uint32_t> blocks{1, kMaxLeafTriangles};  ///< triangles that one test is expected to take
  int repeats = 3;
  bool brief = false;
};

[[noreturn]] void stop(const Error& error) {
  fmt::print(stderr, "build_bvh: {}\n", error.message);
  std::exit(static_cast<int>(error.code));
}

template <class T>
T value_or_stop(Result<T> result) {
  if (!result.ok()) stop(result.error());
  return std::move(result).value();
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// One builder with one setting: what its turns took, and what came out.
struct Row {
  bool ours = false;
  uint32_t block = 1;
  std::vector<double> seconds, cpu_seconds, tree_seconds, plan_seconds, store_seconds;
  WideCost cost;

  void add(const Spent& spent) {
    seconds.push_back(spent.seconds);
    cpu_seconds.push_back(spent.cpu_seconds);
  }
};

struct Table {
  unsigned threads;
  double refs_seconds;
  std::vector<Row> rows;  ///< ours and Embree's by turns
};

/// Blocks of a whole leaf: as `shoal build` builds; others: with Embree's costs.
SahModel model_of(uint32_t block) {
  return block == kMaxLeafTriangles ? SahModel{kMaxLeafTriangles} : SahModel{kMaxLeafTriangles, block, 1};
}

void run_turn(Row& row, RTCDevice device, std::span<const BuildRef> refs) {
  if (row.ours) {
    RefArray copy(refs.size());
    tbb::parallel_for(size_t{0}, refs.size(), [&](size_t i) { copy.refs()[i] = refs[i]; });
    const OurBvh bvh(std::move(copy), model_of(row.block));
    row.add(bvh.spent());
    row.tree_seconds.push_back(bvh.tree_seconds());
    row.plan_seconds.push_back(bvh.plan_seconds());
    row.store_seconds.push_back(bvh.store_seconds());
    if (row.cost.leaves_count == 0) row.cost = measure_cost(bvh.root(), row.block);
    return;
  }
  const EmbreeBvh bvh(device, primitives_of(refs), refs.size(), {kMaxLeafTriangles, row.block});
  if (bvh.root() == 0) stop({ErrorCode::kInternal, "rtcBuildBVH failed"});
  row.add(bvh.spent());
  if (row.cost.leaves_count == 0) row.cost = measure_cost(bvh.root(), row.block);
}

Table measure(const Arguments& arguments, const std::vector<float>& positions, unsigned threads) {
  const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
  RTCDevice device = rtcNewDevice(fmt::format("threads={},set_affinity=0", threads).c_str());
  Table table{threads, 0, {}};
  for (const uint32_t block : arguments.blocks) {
    for (const bool ours : {true, false}) table.rows.emplace_back().ours = ours, table.rows.back().block = block;
  }
  std::vector<double> refs_seconds;
  for (int repeat = 0; repeat < arguments.repeats; ++repeat) {
    const double start = now_seconds();
    const RefArray refs = make_refs(positions);
    refs_seconds.push_back(now_seconds() - start);
    for (Row& row : table.rows) run_turn(row, device, refs.refs());
  }
  table.refs_seconds = median(refs_seconds);
  rtcReleaseDevice(device);
  return table;
}

void print_row(const Row& row) {
  const double seconds = median(row.seconds);
  fmt::print("{:>5}  {:<12} {:>8.3f} {:>8.3f} {:>7.3f} {:>10} {:>10} {:>8.3f}", row.block,
             row.ours ? "ours" : "rtcBuildBVH", seconds, median(row.cpu_seconds),
             static_cast<double>(row.cost.triangles_count) * 1e-6 / seconds, row.cost.nodes_count,
             row.cost.leaves_count, row.cost.tests);
}

double rate(const Row& ours, const Row& theirs) { return median(theirs.seconds) / median(ours.seconds); }
double cpu_rate(const Row& ours, const Row& theirs) { return median(theirs.cpu_seconds) / median(ours.cpu_seconds); }

void print_table(const Table& table) {
  fmt::print("\n{} thread{}; references from triangles, for either: {:.3f} s\n", table.threads,
             table.threads == 1 ? "" : "s", table.refs_seconds);
  fmt::print("{:<5}  {:<12} {:>8} {:>8} {:>7} {:>10} {:>10} {:>8}\n", "block", "", "seconds", "cpu", "M/s", "nodes",
             "leaves", "cost");
  for (size_t i = 0; i < table.rows.size(); i += 2) {
    const Row &ours = table.rows[i], &theirs = table.rows[i + 1];
    print_row(ours);
    fmt::print("  (tree {:.3f}, choice of wide nodes {:.3f}, writing them {:.3f} s)\n", median(ours.tree_seconds),
               median(ours.plan_seconds), median(ours.store_seconds));
    print_row(theirs);
    fmt::print("  ours over this: rate {:.2f} (by cpu {:.2f}), cost {:.3f}\n", rate(ours, theirs),
               cpu_rate(ours, theirs), ours.cost.tests / theirs.cost.tests);
  }
}

Json row_json(const Row& row) {
  Json json = {{"builder", row.ours ? "ours" : "rtcBuildBVH"},
               {"block", row.block},
               {"seconds", row.seconds},
               {"median_seconds", median(row.seconds)},
               {"median_cpu_seconds", median(row.cpu_seconds)},
               {"nodes_count", row.cost.nodes_count},
               {"leaves_count", row.cost.leaves_count},
               {"sah_cost", row.cost.tests}};
  if (row.ours) {
    json["median_tree_seconds"] = median(row.tree_seconds);
    json["median_plan_seconds"] = median(row.plan_seconds);
    json["median_store_seconds"] = median(row.store_seconds);
  }
  return json;
}

Json table_json(const Table& table) {
  Json rows = Json::array();
  for (size_t i = 0; i < table.rows.size(); i += 2) {
    const Row &ours = table.rows[i], &theirs = table.rows[i + 1];
    rows.push_back(row_json(ours));
    rows.push_back(row_json(theirs));
    rows.back()["our_rate_over_this"] = rate(ours, theirs);
    rows.back()["our_cpu_rate_over_this"] = cpu_rate(ours, theirs);
    rows.back()["our_sah_cost_over_this"] = ours.cost.tests / theirs.cost.tests;
  }
  return {{"threads_count", table.threads}, {"refs_seconds", table.refs_seconds}, {"rows", std::move(rows)}};
}

bool costs_more(const Table& table) {
  for (size_t i = 0; i < table.rows.size(); i += 2) {
    if (table.rows[i].cost.tests > kMostCost * table.rows[i + 1].cost.tests) return true;
  }
  return false;
}

int run(const Arguments& arguments) {
  const std::filesystem::path folder = arguments.folder + fmt::format("/shoal-build-bvh-{}", ::getpid());
  const std::string gltf =
      arguments.gltf.empty() ? value_or_stop(generate_terrain(folder.string(), arguments.triangles)) : arguments.gltf;
  const std::vector<float> positions = corner_positions(value_or_stop(read_triangles(gltf)));
  std::error_code code;
  std::filesystem::remove_all(folder, code);
  if (make_refs(positions).size() == 0) stop({ErrorCode::kInput, gltf + ": no triangles"});
  fmt::print("{}: {:.2f} M triangles, leaves of at most {}; median of {}. Cost: areas over the root's, of nodes and, "
             "for each block of their triangles begun, of leaves.\n",
             gltf, static_cast<double>(positions.size()) / 9e6, kMaxLeafTriangles, arguments.repeats);
  Json tables = Json::array();
  bool worse = false;
  for (const unsigned threads : arguments.threads) {
    const Table table = measure(arguments, positions, threads);
    print_table(table);
    tables.push_back(table_json(table));
    worse = worse || costs_more(table);
  }
  if (worse) fmt::print("SAH COST MORE THAN {} OF EMBREE'S\n", kMostCost);
  if (arguments.json.empty()) return worse ? 1 : 0;
  const Json json = {{"triangles_count", positions.size() / 9}, {"tables", std::move(tables)}};
  const std::string text = json.dump(1) + "\n";
  const Status written = write_whole_file(posix_file_system(), arguments.json, std::as_bytes(std::span(text)));
  if (!written.ok()) stop(written.error());
  return worse ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app{"Building in memory: our binned-SAH tree of 8 children a node beside Embree's", "build_bvh"};
  app.add_option("--triangles", arguments.triangles, "of the generated terrain, such as 10M")
      ->transform(CLI::AsNumberWithUnit(
          std::map<std::string, uint64_t>{{"K", 1000}, {"M", 1000000}, {"G", 1000000000}}))
      ->capture_default_str();
  app.add_option("--gltf", arguments.gltf, "built in place of the terrain");
  app.add_option("--threads", arguments.threads, "numbers of threads, one table each")
      ->delimiter(',')
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  app.add_option("--blocks", arguments.blocks, "triangles that a test is expected to take, of both builders")
      ->delimiter(',')
      ->check(CLI::IsMember({1, 2, 4, 8, 16, 32}))
      ->capture_default_str();
  app.add_option("--repeats", arguments.repeats, "turns of each builder")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  app.add_option("--folder", arguments.folder, "for the generated terrain")->capture_default_str();
  app.add_flag("--short", arguments.brief, "a small scene and one turn, to see that it works");
  app.add_option("--json", arguments.json, "the figures as JSON");
  CLI11_PARSE(app, argc, argv);
  if (arguments.brief) arguments.triangles = 50'000, arguments.repeats = 1;
  return run(arguments);
}
