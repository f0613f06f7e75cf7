#include "engine/choose_order.h"

#include <fmt/format.h>

#include <algorithm>

namespace shoal {
namespace {

/// Below that a trial is too short to say anything: a tenth of a second or so.
constexpr uint64_t kLeastTrialSamples = 1u << 16;
/// A render has so many trials' samples at least: so the orders that lose take at most three sixteenths of it.
constexpr uint64_t kTrialsARender = 16;
/// An order that is tried must take so much less time than the queued one: trials are that uncertain.
constexpr double kWorthChanging = 0.95;
/// Pages so small are read in a blink, whoever asks for them, and then the hybrid order is the fastest in scenes of that
/// size (docs/decisions/0018). Larger scenes begin with the order that reads ahead.
constexpr uint64_t kSmallSceneBytes = 256ull << 20;

double nanoseconds_a_test(const OrderTrial& trial) {
  return 1e9 * trial.seconds / static_cast<double>(std::max<uint64_t>(trial.tests, 1));
}

}  // namespace

uint64_t trial_samples(const MemoryPlan& plan) {
  return std::max<uint64_t>(2ull * plan.paths_in_flight, kLeastTrialSamples);
}

FirstChoice choose_before_trials(Order asked, const MemoryPlan& plan, uint64_t samples) {
  if (asked != Order::kAuto) return {{asked, "asked for"}};
  if (plan.cache_bytes < plan.scene_page_bytes()) return {{Order::kQueued, "the page cache cannot hold every page"}};
  if (!plan.every_order_fits) return {{Order::kQueued, "too little memory to try others"}};
  if (samples / kTrialsARender >= trial_samples(plan)) return {{Order::kQueued, "loads the pages"}, true};
  if (plan.scene_page_bytes() <= kSmallSceneBytes) {
    return {{Order::kHybrid, "a small scene in memory, too few samples to try others"}};
  }
  return {{Order::kQueued, "too few samples to try others"}};
}

ChosenOrder choose_by_trials(std::span<const OrderTrial> trials) {
  const auto cost = [](const OrderTrial& trial) {
    return nanoseconds_a_test(trial) * (trial.order == Order::kQueued ? kWorthChanging : 1.0);
  };
  const auto best = std::min_element(trials.begin(), trials.end(),
                                     [&](const OrderTrial& a, const OrderTrial& b) { return cost(a) < cost(b); });
  std::string reason = "tried, ns of processor time a ray or triangle test:";
  for (const OrderTrial& trial : trials) {
    reason += fmt::format("{} {} {:.2f}", &trial == &trials.front() ? "" : ",", order_name(trial.order),
                          nanoseconds_a_test(trial));
  }
  return {best->order, reason};
}

}  // namespace shoal
