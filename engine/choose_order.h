// Which order a render takes when it may choose (`--order auto`). Every order gives the same bits, so the choice is
// free: where pages do not fit in the cache it is the queued order, which reads least; where they do, and the picture
// is long enough, each order renders a part of the samples with the pages in memory, and the one that took the least
// processor time for its work goes on; small scenes in short renders get the hybrid order at once (docs/decisions/0017,
// 0018: what was measured). Called by engine/render. Pure
// functions of numbers.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "engine/memory_plan.h"
#include "engine/render.h"

namespace shoal {

/// What is tried, in this turn. Before, as many samples are rendered queued, which loads the pages.
inline constexpr Order kTriedOrders[] = {Order::kHybrid, Order::kDepthFirst, Order::kSorted, Order::kQueued};

/// Samples of one trial: twice the paths in flight, so that queues and waves fill.
uint64_t trial_samples(const MemoryPlan& plan);

/// The choice where nothing need be tried, which is also what begins a render.
struct FirstChoice {
  ChosenOrder chosen;
  bool to_be_tried = false;  ///< trials follow
};
FirstChoice choose_before_trials(Order asked, const MemoryPlan& plan, uint64_t samples);

struct OrderTrial {
  Order order;
  double seconds = 0;   ///< processor time of all threads: other programs do not disturb it
  uint64_t tests = 0;   ///< rays and the triangles they test: for a sample nearly the same in every order
};
/// Requires: not empty.
ChosenOrder choose_by_trials(std::span<const OrderTrial> trials);

}  // namespace shoal
