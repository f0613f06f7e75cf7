#include "bench/traffic_report.h"

#include <fmt/format.h>

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
  fmt::print("L2 of {}", describe(run.cache.outer));
  if (run.cache.inner.has_value()) fmt::print(", behind an L1 of {}", describe(*run.cache.inner));
  if (run.cache.sample > 1) fmt::print("; one in {} sets is modelled", run.cache.sample);
  fmt::print("; {} the kernels' prefetches\n\n", run.prefetches ? "with" : "without");
  std::fflush(stdout);
}

void print_orders(const TrafficRun& run, const std::vector<OrderTraffic>& orders) {
  const uint64_t line_bytes = run.cache.outer.line_bytes;
  fmt::print("{:<12} {:>12} {:>12} {:>10} {:>8} {:>6} |", "order", "fills", "write-backs", "MB", "bytes/", "of");
  for (const char* kind : kDataKinds) fmt::print(" {:>13}", kind);
  fmt::print("\n{:<12} {:>12} {:>12} {:>10} {:>8} {:>6} | bytes a ray of each kind, fills and write-backs\n", "",
             "lines", "lines", "moved", "ray", name_of(orders.front().order) + std::string(" "));
  for (const OrderTraffic& order : orders) {
    const uint64_t bytes = order.lines.total() * line_bytes;
    fmt::print("{:<12} {:>12} {:>12} {:>10.1f} {:>8.1f} {:>6.3f} |", name_of(order.order), order.lines.fills,
               order.lines.write_backs, static_cast<double>(bytes) / 1e6, per(bytes, run.rays),
               per(order.lines.total(), orders.front().lines.total()));
    for (const LineCounts& lines : order.lines_of_kind) {
      fmt::print(" {:>13.1f}", per(lines.total() * line_bytes, run.rays));
    }
    fmt::print("\n");
  }
  for (const OrderTraffic& order : orders) {
    fmt::print("{}{}: {:.2f} node tests, {:.2f} triangle tests, {:.2f} treelets a ray, {} drains\n",
               &order == orders.data() ? "\n" : "", name_of(order.order), per(order.counts.node_tests, run.rays),
               per(order.counts.triangle_tests, run.rays), per(order.counts.treelet_visits, run.rays),
               order.counts.drains);
  }
}

nlohmann::ordered_json to_json(const TrafficRun& run, const std::vector<OrderTraffic>& orders) {
  nlohmann::ordered_json json = {
      {"scene", run.scene},           {"triangles_count", run.triangles}, {"treelets_count", run.treelets},
      {"scene_bytes", run.scene_bytes}, {"workload", run.workload},         {"rays_count", run.rays},
      {"in_flight_count", run.in_flight}, {"prefetches", run.prefetches},     {"sampled_sets_one_in", run.cache.sample},
      {"l2", to_json(run.cache.outer)}};
  json["l1"] = run.cache.inner.has_value() ? to_json(*run.cache.inner) : nlohmann::ordered_json();
  for (const OrderTraffic& order : orders) {
    nlohmann::ordered_json row = {{"order", name_of(order.order)},
                                  {"moved_bytes", order.lines.total() * run.cache.outer.line_bytes}};
    row.update(to_json(order.lines, run.cache.outer.line_bytes));
    row["bytes_per_ray"] = per(order.lines.total() * run.cache.outer.line_bytes, run.rays);
    row["over_first"] = per(order.lines.total(), orders.front().lines.total());
    for (uint8_t kind = 0; kind < kDataKindCount; ++kind) {
      row["kinds"][kDataKinds[kind]] = to_json(order.lines_of_kind[kind], run.cache.outer.line_bytes);
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
