// Where the time of a render goes: every thread is in one phase at a time, and a clock a thread adds up how long. So the
// phases of a thread exclude each other and sum to the time of the render. Called by engine/render_*; reported by
// engine/render_report.
//
// Properties and assumptions
//   begin      with the render, in Phase::kSetup; no time is left out until the clocks are settled at its end.
//   use        each piece of work enters its phase when it begins; none goes back to the phase before.
//   threads    one at a time: the thread it belongs to, or the one that starts and awaits the threads.
//   cost       a change of phase 10 ns, to enter the phase it is in a comparison: rays change phase in groups of up to 64,
//              vertices one by one.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "io/ticks.h"

namespace shoal {

// X(enumerator, name, sentence)
#define SHOAL_PHASES(X)                                                                                               \
  X(kTraversal, "traversal", "crossing treelets")                                                                     \
  X(kTopTree, "top_tree", "finding the next treelet of rays in the top tree")                                         \
  X(kQueue, "queue", "rays to and from queues, paths to lists; sorted: keys, sorting, fetching rays in order")         \
  X(kShading, "shading", "surfaces, textures, lights, bounces")                                                       \
  X(kPaths, "paths", "beginning paths, noting answers of rays, adding paths to the film")                             \
  X(kPaging, "paging", "pinning pages, reading and decoding those that are missed, waiting for reads")                \
  X(kScheduling, "scheduling", "choosing treelets, starting reads ahead")                                             \
  X(kIdle, "idle", "nothing to do: other threads have the rest in hand")                                              \
  X(kReporting, "reporting", "progress and previews")                                                                 \
  X(kSetup, "setup", "before and after the threads work: tables, plan, memory, the finished picture")

enum class Phase : uint8_t {
#define SHOAL_DECLARE(enumerator, name, sentence) enumerator,
  SHOAL_PHASES(SHOAL_DECLARE)
#undef SHOAL_DECLARE
};

inline constexpr std::string_view kPhaseNames[] = {
#define SHOAL_DECLARE(enumerator, name, sentence) name,
    SHOAL_PHASES(SHOAL_DECLARE)
#undef SHOAL_DECLARE
};
inline constexpr size_t kPhaseCount = std::size(kPhaseNames);

/// Alone on its cache lines: every thread writes to its own.
class alignas(64) PhaseClock {
 public:
  explicit PhaseClock(uint64_t now) : since_(now) {}

  void enter(Phase phase) {
    if (phase != phase_) enter_at(phase, now_ticks());
  }
  void enter_at(Phase phase, uint64_t now) {
    settle(now);
    phase_ = phase;
  }
  /// The time until `now` is the current phase's. Time that runs backwards is none.
  void settle(uint64_t now) {
    if (now <= since_) return;
    ticks_[static_cast<size_t>(phase_)] += now - since_;
    since_ = now;
  }
  /// So many ticks of the current phase, among the last ones, were another's.
  void give_to(Phase other, uint64_t ticks, uint64_t now) {
    settle(now);
    const uint64_t given = std::min(ticks, ticks_[static_cast<size_t>(phase_)]);
    ticks_[static_cast<size_t>(phase_)] -= given;
    ticks_[static_cast<size_t>(other)] += given;
  }
  uint64_t ticks(Phase phase) const { return ticks_[static_cast<size_t>(phase)]; }
  /// Until when the time is some phase's.
  uint64_t settled_at() const { return since_; }

 private:
  uint64_t since_;
  Phase phase_ = Phase::kSetup;
  std::array<uint64_t, kPhaseCount> ticks_{};
};

/// Seconds by phase, of all threads.
struct PhaseTimes {
  std::array<double, kPhaseCount> seconds{};

  double of(Phase phase) const { return seconds[static_cast<size_t>(phase)]; }
  double total() const {
    double sum = 0;
    for (const double value : seconds) sum += value;
    return sum;
  }
  /// Of the whole time, from 0 to 1.
  double share(Phase phase) const { return total() > 0 ? of(phase) / total() : 0; }
  /// What it takes to bring rays from one treelet to the next.
  double routing_share() const { return share(Phase::kTopTree) + share(Phase::kQueue); }
};

/// The clocks of all threads, settled, in seconds.
inline PhaseTimes phase_times(std::span<const PhaseClock> clocks, double seconds_a_tick) {
  PhaseTimes times;
  for (const PhaseClock& clock : clocks) {
    for (size_t i = 0; i < kPhaseCount; ++i) {
      times.seconds[i] += static_cast<double>(clock.ticks(static_cast<Phase>(i))) * seconds_a_tick;
    }
  }
  return times;
}

}  // namespace shoal
