#include "bench/traffic_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

namespace shoal::bench {
namespace {

double per(uint64_t count, uint64_t of) {
  return static_cast<double>(count) / static_cast<double>(std::max<uint64_t>(of, 1));
}

std::string describe(const CacheShape& shape) {
  return fmt::format("{} KiB, {} ways, lines of {} bytes", shape.bytes >> 10, shape.ways, shape.line_bytes);
}

nlohmann::ordered_json to_json(const CacheShape& shape) {
  return {{"bytes", shape.bytes}, {"ways", shape.ways}, {"line_bytes", shape.line_bytes}};
}

nlohmann::ordered_json to_json(const LineCounts& lines, uint32_t line_bytes) {
  return {{"fill_bytes", lines.fills * line_bytes}, {"write_back_bytes", lines.write_backs * line_bytes}};
}

}  // namespace

void print_run(const TrafficRun& run) {
  fmt::print("{}: {} triangles, {} treelets, {:.1f} MB; {} rays of {}, at most {} waiting in queues; one thread\n",
             run.scene, run.triangles, run.treelets, static_cast<double>(run.scene_bytes) / 1e6, run.rays, run.workload,
             run.in_flight);
  fmt::print("L2 of {}", describe(run.cache.levels.back()));
  if (run.cache.levels.size() > 1) fmt::print(", behind an L1 of {}", describe(run.cache.levels[0]));
  if (run.cache.one_in > 1) fmt::print("; one in {} sets is modelled", run.cache.one_in);
  fmt::print("; {} the kernels' prefetches\n\n", run.prefetches ? "with" : "without");
  fmt::print("{:<11} {:>21} {:>10} {:>7} {:>6} | {:<75} | {:^31} |\n", "", "lines", "MB", "bytes/", "over",
             "bytes a ray, fills and write-backs", "a ray");
  fmt::print("{:<11} {:>10} {:>10} {:>10} {:>7} {:>6} |", "order", "fills", "back", "moved", "ray", "first");
  for (const char* kind : kDataKinds) fmt::print(" {:>8}", kind);
  fmt::print("    | {:>7} {:>9} {:>9}    | {:>7}\n", "nodes", "triangles", "treelets", "drains");
  std::fflush(stdout);
}

void print_newest(const TrafficRun& run, const std::vector<OrderTraffic>& orders) {
  const OrderTraffic& order = orders.back();
  const uint64_t bytes = order.lines.total() * run.cache.levels.back().line_bytes;
  fmt::print("{:<11} {:>10} {:>10} {:>10.1f} {:>7.1f} {:>6.3f} |", name_of(order.order), order.lines.fills,
             order.lines.write_backs, static_cast<double>(bytes) / 1e6, per(bytes, run.rays),
             per(order.lines.total(), orders.front().lines.total()));
  for (const LineCounts& lines : order.lines_of_kind) {
    fmt::print(" {:>8.1f}", per(lines.total() * run.cache.levels.back().line_bytes, run.rays));
  }
  fmt::print("    | {:>7.2f} {:>9.2f} {:>9.3f}    | {:>7}\n", per(order.counts.node_tests, run.rays),
             per(order.counts.triangle_tests, run.rays), per(order.counts.treelet_visits, run.rays),
             order.counts.drains);
  std::fflush(stdout);
}

nlohmann::ordered_json to_json(const TrafficRun& run, const std::vector<OrderTraffic>& orders) {
  nlohmann::ordered_json json = {
      {"scene", run.scene},           {"triangles_count", run.triangles}, {"treelets_count", run.treelets},
      {"scene_bytes", run.scene_bytes}, {"workload", run.workload},         {"rays_count", run.rays},
      {"in_flight_count", run.in_flight}, {"prefetches", run.prefetches},     {"sampled_sets_one_in", run.cache.one_in},
      {"l2", to_json(run.cache.levels.back())}};
  json["l1"] = run.cache.levels.size() > 1 ? to_json(run.cache.levels[0]) : nlohmann::ordered_json();
  for (const OrderTraffic& order : orders) {
    nlohmann::ordered_json row = {{"order", name_of(order.order)},
                                  {"moved_bytes", order.lines.total() * run.cache.levels.back().line_bytes}};
    row.update(to_json(order.lines, run.cache.levels.back().line_bytes));
    row["bytes_per_ray"] = per(order.lines.total() * run.cache.levels.back().line_bytes, run.rays);
    row["over_first"] = per(order.lines.total(), orders.front().lines.total());
    for (uint8_t kind = 0; kind < kDataKindCount; ++kind) {
      row["kinds"][kDataKinds[kind]] = to_json(order.lines_of_kind[kind], run.cache.levels.back().line_bytes);
    }
    row["node_tests_count"] = order.counts.node_tests;
    row["triangle_tests_count"] = order.counts.triangle_tests;
    row["treelet_visits_count"] = order.counts.treelet_visits;
    row["drains_count"] = order.counts.drains;
    json["orders"].push_back(row);
  }
  return json;
}

}  // namespace shoal::bench
