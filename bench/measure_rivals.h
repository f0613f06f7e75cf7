// One row of bench/against_embree: the same rays through every order of ours and every way of Embree's, in one run.
// Each program runs once to warm up, when its answers are compared, then the programs take turns, so that what else
// the machine does falls on all alike; medians count.
#pragma once

#include "bench/embree_scene.h"
#include "bench/memory_orders.h"

namespace shoal::bench {

inline constexpr size_t kOrderCount = 4;
inline constexpr MemoryOrder kOrders[kOrderCount] = {MemoryOrder::kDepthFirst, MemoryOrder::kSorted,
                                                     MemoryOrder::kQueued, MemoryOrder::kHybrid};
/// Hits whose distances differ by more than this part are not the same hit...
inline constexpr float kSameHit = 1e-4f;
/// ...unless that is what rounding does: so many units in the last place of the scene's largest coordinate. Each of the
/// two tests errs by some six (treelets/ray_space.h), and surfaces that nearly touch are hit at no distance at all.
inline constexpr float kSameHitRoundings = 16;

struct MeasureOptions {
  OrderOptions order;
  unsigned repeats = 3;
  bool cpu_time = false;  ///< TeamSeconds::cpu instead of wall time
};

/// Rates in million rays a second.
struct RivalRow {
  std::string workload;
  unsigned threads = 1;
  uint64_t rays = 0, hits = 0;
  double shoal[kOrderCount] = {};
  TraceCounts counts[kOrderCount];
  double embree_default = 0, embree_compact = 0;
  double embree_packet = 0, embree_stream = 0, embree_sorted = 0;  ///< over the faster of the two scenes
  uint64_t stream_rays = 0;  ///< a call, of the fastest stream
  double bound = 0;
  double cpu_share = 0;  ///< CPU over wall time, all turns: below 1, others had the cores
  uint64_t disagreeing = 0;        ///< rays, of the program of Embree's that differs most from ours
  uint64_t orders_disagreeing = 0;  ///< rays whose answers our own orders do not give to the bit: a bug

  size_t best_order() const { return static_cast<size_t>(std::max_element(shoal, shoal + kOrderCount) - shoal); }
  double best_shoal() const { return shoal[best_order()]; }
  double embree_single() const { return std::max(embree_default, embree_compact); }
};

RivalRow measure_rivals(const MemoryScene& scene, const EmbreeScene& usual, const EmbreeScene& compact,
                        const RaySet& set, const MeasureOptions& options);

}  // namespace shoal::bench
