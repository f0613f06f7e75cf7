#include "bench/rival_report.h"

#include <fmt/format.h>

#include <cstdio>

namespace shoal::bench {
namespace {

double per(uint64_t count, uint64_t of) {
  return static_cast<double>(count) / static_cast<double>(std::max<uint64_t>(of, 1));
}

/// Keys in JSON.
constexpr const char* kOrderKeys[kOrderCount] = {"depth_first", "sorted", "queued", "hybrid"};

std::string rate_columns(std::initializer_list<double> rates) {
  std::string line = " |";
  for (const double rate : rates) line += fmt::format(" {:>7.3f}", rate);
  return line;
}

}  // namespace

void print_scene(const RivalScene& scene) {
  const auto bytes = [&](uint64_t count) { return per(count, scene.triangles); };
  fmt::print("{}: {} triangles, {} treelets\n", scene.name, scene.triangles, scene.treelets);
  fmt::print("bytes a triangle: Shoal {:.1f}; Embree default {:.1f}, compact {:.1f}; vertices and indices {:.1f}\n",
             bytes(scene.shoal_bytes), bytes(scene.embree_default_bytes), bytes(scene.embree_compact_bytes),
             bytes(scene.mesh_bytes));
  fmt::print("Embree {}.{}.{}, {}, built in {:.1f} s (default) and {:.1f} s (compact)\n", RTC_VERSION_MAJOR,
             RTC_VERSION_MINOR, RTC_VERSION_PATCH, scene.robust ? "robust" : "not robust",
             scene.embree_default_seconds, scene.embree_compact_seconds);
  fmt::print("its contexts say coherent for primary rays, incoherent for all others; packets of 16, streams and\n"
             "sorted rays go through the faster of its scenes. Million rays a second, by {} time\n\n",
             scene.cpu_time ? "CPU" : "wall");
}

void print_header() {
  fmt::print("{:<44} | {:^31} | {:^39} |\n", "", "Shoal", "Embree");
  fmt::print("{:<12} {:>2} {:>8} {:>5} {:<11}", "workload", "th", "rays", "hit", "best order");
  fmt::print("  | {:>7} {:>7} {:>7} {:>7} | {:>7} {:>7} {:>7} {:>7} {:>7} | {:>7} |", "depth", "sorted", "queued",
             "hybrid", "default", "compact", "packet", "stream", "sorted", "bound");
  fmt::print(" {:>7} {:>7} | {:>6} {:>5}\n", "/Embree", "/bound", "differ", "CPU");
  std::fflush(stdout);
}

void print_row(const RivalRow& row) {
  fmt::print("{:<12} {:>2} {:>8} {:>5.3f} {:<11} ", row.workload, row.threads, row.rays, per(row.hits, row.rays),
             name_of(kOrders[row.best_order()]));
  fmt::print("{}{}{} |", rate_columns({row.shoal[0], row.shoal[1], row.shoal[2], row.shoal[3]}),
             rate_columns({row.embree_default, row.embree_compact, row.embree_packet, row.embree_stream,
                           row.embree_sorted}),
             rate_columns({row.bound}));
  fmt::print(" {:>7.2f} {:>7.2f} | {:>6} {:>5.2f}\n", row.best_shoal() / row.embree_single(),
             row.best_shoal() / row.bound, row.disagreeing, row.cpu_share);
  std::fflush(stdout);
}

nlohmann::ordered_json to_json(const RivalScene& scene, const RivalRow& row) {
  nlohmann::ordered_json json = {
      {"scene", scene.name},
      {"workload", row.workload},
      {"threads", row.threads},
      {"shoal_mrays_per_s", row.best_shoal()},
      {"shoal_order", name_of(kOrders[row.best_order()])},
      {"embree_mrays_per_s", row.embree_single()},
      {"embree_packet_mrays_per_s", row.embree_packet},
      {"embree_stream_mrays_per_s", row.embree_stream},
      {"embree_sorted_mrays_per_s", row.embree_sorted},
      {"bound_mrays_per_s", row.bound},
      {"embree_default_mrays_per_s", row.embree_default},
      {"embree_compact_mrays_per_s", row.embree_compact},
      {"embree_stream_rays_count", row.stream_rays},
      {"embree_robust", scene.robust},
      {"clock", scene.cpu_time ? "cpu" : "wall"},
      {"triangles_count", scene.triangles},
      {"treelets_count", scene.treelets},
      {"rays_count", row.rays},
      {"hits_count", row.hits},
      {"disagreeing_rays_count", row.disagreeing},
      {"cpu_share", row.cpu_share},
      {"shoal_bytes_per_triangle", per(scene.shoal_bytes, scene.triangles)},
      {"embree_default_bytes_per_triangle", per(scene.embree_default_bytes, scene.triangles)},
      {"embree_compact_bytes_per_triangle", per(scene.embree_compact_bytes, scene.triangles)},
      {"mesh_bytes_per_triangle", per(scene.mesh_bytes, scene.triangles)}};
  for (size_t i = 0; i < kOrderCount; ++i) {
    const std::string key = kOrderKeys[i];
    json[key + "_mrays_per_s"] = row.shoal[i];
    json[key + "_node_tests_per_ray"] = per(row.counts[i].node_tests, row.rays);
    json[key + "_triangle_tests_per_ray"] = per(row.counts[i].triangle_tests, row.rays);
    json[key + "_treelets_per_ray"] = per(row.counts[i].treelet_visits, row.rays);
  }
  json["queued_rays_per_drain"] = per(row.rays == 0 ? 0 : row.counts[2].treelet_visits, row.counts[2].drains);
  return json;
}

}  // namespace shoal::bench
