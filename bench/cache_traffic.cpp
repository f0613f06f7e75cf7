// bench/cache_traffic: what moves between memory and L2 while the same rays are traced in each order: every address
// that tracing touches goes through a model of the cache. docs/measuring.md says what is modelled and what is not.
//
//   bench/cache_traffic [--scene F.shoal|F.gltf | --triangles N] [--rays N] [--workload W] [--orders a,b]
//       [--in-flight N] [--queue sweep|fullest] [--l2 SIZE] [--ways N] [--line BYTES] [--l1 SIZE] [--l1-ways N]
//       [--no-prefetches] [--sample N] [--only-trace N] [--folder DIR] [--short] [--json F]
#include <fmt/format.h>

#include <thread>

#include <CLI/CLI.hpp>

#include "bench/given_scene.h"
#include "bench/ray_workloads.h"
#include "bench/touched_orders.h"
#include "bench/traffic_report.h"
#include "queues/ray_sorter.h"

namespace {

using namespace shoal;
using namespace shoal::bench;
namespace fs = std::filesystem;

constexpr MemoryOrder kAllOrders[] = {MemoryOrder::kDepthFirst, MemoryOrder::kSorted, MemoryOrder::kQueued};

struct Arguments {
  GivenScene scene{.path = "", .triangles = 40'000'000};
  std::string folder = fs::temp_directory_path().string(), json, workload = "scene-random";
  uint64_t rays = 16'000'000, in_flight = 0;
  std::vector<MemoryOrder> orders{std::begin(kAllOrders), std::end(kAllOrders)};
  QueueChoice choice = QueueChoice::kSweep;
  CacheModel::Options cache;
  CacheShape inner{.bytes = 0, .ways = 12}, outer;
  bool no_prefetches = false, brief = false;
  unsigned only_trace = 0;
};

Error another(MemoryOrder order, const std::string& what, uint64_t found, uint64_t expected) {
  return {ErrorCode::kInternal, fmt::format("{}: {}: {} as re-enacted, {} by the order itself", name_of(order), what,
                                            found, expected)};
}

/// Traces the rays by the order itself: what was re-enacted must be just that.
Status check_order(const MemoryScene& scene, const OrderOptions& options, const RaySet& set, const OrderTraffic& found,
                   std::span<const RayAnswer> answers) {
  std::vector<RayAnswer> expected_answers(set.rays.size());
  const TraceCounts expected =
      make_order(found.order, scene, options, set.rays.size())->run(set, expected_answers).counts;
  const TraceCounts& counts = found.counts;
  const struct {
    const char* what;
    uint64_t found, expected;
  } pairs[] = {{"node tests", counts.node_tests, expected.node_tests},
               {"triangle tests", counts.triangle_tests, expected.triangle_tests},
               {"treelet visits", counts.treelet_visits, expected.treelet_visits},
               {"drains", counts.drains, expected.drains}};
  for (const auto& pair : pairs) {
    if (pair.found != pair.expected) return another(found.order, pair.what, pair.found, pair.expected);
  }
  for (size_t i = 0; i < answers.size(); ++i) {
    if (answers[i].primitive != expected_answers[i].primitive || answers[i].t != expected_answers[i].t) {
      return another(found.order, fmt::format("the triangle that ray {} hits", i), answers[i].primitive,
                     expected_answers[i].primitive);
    }
  }
  return {};
}

Result<OrderTraffic> traffic_of(MemoryOrder order, const MemoryScene& scene, const OrderOptions& options,
                                const RaySet& set, const TrafficRun& run) {
  CacheModel cache(run.cache);
  ModelSink sink(cache, run.prefetches);
  TouchLog log(sink);
  LargeVector<RayAnswer> answers(set.rays.size());
  OrderTraffic traffic;
  traffic.order = order;
  traffic.counts = touch_order(order, scene, options, set, answers, log);
  log.flush();
  cache.flush();
  traffic.lines = cache.counts();
  for (uint8_t kind = 0; kind < kDataKindCount; ++kind) traffic.lines_of_kind[kind] = cache.counts(kind);
  SHOAL_RETURN_IF_ERROR(check_order(scene, options, set, traffic, answers));
  return traffic;
}

/// For other programs that count: the rays through the orders themselves, so many times, and no model.
void only_trace(const Arguments& arguments, const MemoryScene& scene, const OrderOptions& options, const RaySet& set) {
  LargeVector<RayAnswer> answers(set.rays.size());
  for (const MemoryOrder order : arguments.orders) {
    const auto traced = make_order(order, scene, options, set.rays.size());
    for (unsigned i = 0; i < arguments.only_trace; ++i) traced->run(set, answers);
    fmt::print("{}: {} rays traced {} times\n", name_of(order), set.rays.size(), arguments.only_trace);
  }
}

Status check_scene(const MemoryScene& scene, const RaySet& set) {
  const TopTree& tree = scene.top_tree();
  if (tree.instance_count() != 1 || tree.instance(0).identity == 0) {
    return Error{ErrorCode::kUsage,
                 scene.scene.file->path() + ": only scenes of one instance are re-enacted (terrain, tile)"};
  }
  if (set.rays.size() >= RaySorter::kMaxSlots) return Error{ErrorCode::kUsage, "more rays than can be sorted at once"};
  return {};
}

Status run(const Arguments& arguments) {
  const WorkFolder folder(arguments.folder, "cache-traffic");
  SHOAL_ASSIGN_OR_RETURN(const std::string path, scene_file(arguments.scene, folder));
  SHOAL_ASSIGN_OR_RETURN(const MemoryScene scene, load_into_memory(path));
  TrafficRun traffic;
  RaySet set;
  {
    SHOAL_ASSIGN_OR_RETURN(const WorldMesh mesh, take_mesh(scene));
    traffic.triangles = mesh.triangle_count();
    const unsigned threads = std::max(1u, std::thread::hardware_concurrency());
    SHOAL_ASSIGN_OR_RETURN(set, RayWorkloads(scene, mesh, arguments.rays, threads).make(arguments.workload));
  }
  SHOAL_RETURN_IF_ERROR(check_scene(scene, set));
  OrderOptions options;
  options.in_flight = arguments.in_flight > 0 ? arguments.in_flight : set.rays.size();
  options.choice = arguments.choice;
  if (arguments.only_trace > 0) {
    only_trace(arguments, scene, options, set);
    return {};
  }

  traffic.scene = arguments.scene.name(), traffic.workload = arguments.workload;
  traffic.treelets = scene.pages.size();
  traffic.scene_bytes = scene.geometry_bytes + scene.top_tree().resident_bytes();
  traffic.rays = set.rays.size(), traffic.in_flight = options.in_flight;
  traffic.cache = arguments.cache, traffic.prefetches = !arguments.no_prefetches;
  print_run(traffic);
  std::vector<OrderTraffic> orders;
  for (const MemoryOrder order : arguments.orders) {
    SHOAL_ASSIGN_OR_RETURN(const OrderTraffic found, traffic_of(order, scene, options, set, traffic));
    orders.push_back(found);
    print_newest(traffic, orders);
  }
  if (arguments.json.empty()) return {};
  const std::string text = to_json(traffic, orders).dump(1) + "\n";
  return write_whole_file(posix_file_system(), arguments.json, std::as_bytes(std::span(text)));
}

void add_scene_options(CLI::App& app, Arguments& arguments) {
  const CLI::AsNumberWithUnit thousands(
      std::map<std::string, uint64_t>{{"K", 1000}, {"M", 1000000}, {"G", 1000000000}});
  auto* scene = app.add_option("--scene", arguments.scene.path, "a .shoal, or a .gltf that is built first");
  app.add_option("--triangles", arguments.scene.triangles, "of the generated terrain, such as 40M")
      ->transform(thousands)
      ->excludes(scene)
      ->capture_default_str();
  app.add_option("--rays", arguments.rays, "how many, such as 16M")
      ->transform(thousands)
      ->check(CLI::Range(1000, 200'000'000))
      ->capture_default_str();
  app.add_option("--workload", arguments.workload, "as of against_embree")
      ->check(CLI::IsMember(std::vector<std::string>(std::begin(kWorkloads), std::end(kWorkloads))))
      ->capture_default_str();
  app.add_option("--orders", arguments.orders, "which, with commas between; the first is what others are compared with")
      ->delimiter(',')
      ->transform(CLI::CheckedTransformer(std::map<std::string, MemoryOrder>{{"depth-first", MemoryOrder::kDepthFirst},
                                                                             {"sorted", MemoryOrder::kSorted},
                                                                             {"queued", MemoryOrder::kQueued}}));
  app.add_option("--in-flight", arguments.in_flight, "rays in queues at once, such as 4M (default: all)")
      ->transform(thousands);
  app.add_option("--queue", arguments.choice, "which treelet is drained next: sweep or fullest")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, QueueChoice>{{"sweep", QueueChoice::kSweep}, {"fullest", QueueChoice::kFullest}}));
  app.add_option("--folder", arguments.folder, "for what is generated and built")->capture_default_str();
  app.add_flag("--short", arguments.brief, "a small scene, few rays and a small cache, to see that it works");
  app.add_option("--json", arguments.json, "the figures as JSON");
}

void add_cache_options(CLI::App& app, Arguments& arguments) {
  app.add_option("--l2", arguments.outer.bytes, "size of the cache, such as 2M")
      ->transform(CLI::AsSizeValue(false))
      ->capture_default_str();
  app.add_option("--ways", arguments.outer.ways, "places of a set")->capture_default_str();
  app.add_option("--line", arguments.outer.line_bytes, "bytes of a line")->capture_default_str();
  app.add_option("--l1", arguments.inner.bytes, "size of a cache in front of it, such as 48K (default: none)")
      ->transform(CLI::AsSizeValue(false));
  app.add_option("--l1-ways", arguments.inner.ways, "its places of a set")->capture_default_str();
  app.add_flag("--no-prefetches", arguments.no_prefetches, "leave out what the kernels ask for ahead of time");
  app.add_option("--sample", arguments.cache.one_in, "model one in so many sets of the cache, a power of two")
      ->capture_default_str();
  app.add_option("--only-trace", arguments.only_trace,
                 "trace so many times by the orders themselves and model nothing: for other programs that count");
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app{"Bytes between memory and L2, by a model of the cache, in each order of rays", "cache_traffic"};
  add_scene_options(app, arguments);
  add_cache_options(app, arguments);
  CLI11_PARSE(app, argc, argv);
  if (arguments.brief) {
    arguments.scene.triangles = 50'000, arguments.rays = 20'000;
    arguments.outer.bytes = 128u << 10;
  }
  if (arguments.inner.bytes > 0) {
    arguments.inner.line_bytes = arguments.outer.line_bytes;
    arguments.cache.levels = {arguments.inner, arguments.outer};
  } else {
    arguments.cache.levels = {arguments.outer};
  }
  Status status = arguments.cache.check();
  if (status.ok()) status = run(arguments);
  if (status.ok()) return 0;
  fmt::print(stderr, "cache_traffic: {}\n", status.error().message);
  return static_cast<int>(status.error().code);
}
