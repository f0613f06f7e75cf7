// What bench/cache_traffic has found, printed and as JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "bench/memory_orders.h"
#include "bench/touch_meter.h"

namespace shoal::bench {

struct TrafficRun {
  std::string scene, workload;
  uint64_t triangles = 0, treelets = 0, scene_bytes = 0, rays = 0, in_flight = 0;
  CacheModel::Options cache;
  bool prefetches = true;
};

/// Of one order.
struct OrderTraffic {
  MemoryOrder order = MemoryOrder::kDepthFirst;
  TraceCounts counts;
  LineCounts lines, lines_of_kind[kDataKindCount];
};

void print_run(const TrafficRun& run);
/// The last of `orders` as a line of the table; the first is what it is compared with.
void print_newest(const TrafficRun& run, const std::vector<OrderTraffic>& orders);
nlohmann::ordered_json to_json(const TrafficRun& run, const std::vector<OrderTraffic>& orders);

}  // namespace shoal::bench
