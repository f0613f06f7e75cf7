// Which treelets are worked on next, and which are wanted from the disk: one policy a file behind this one-method
// interface. A policy sees numbers and returns a decision as a value; it moves nothing itself. Called by
// engine/treelet_scheduler under a lock, one decision at a time, each good for a number of drains.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "treelets/ray.h"

namespace shoal {

/// A treelet with work: rays to trace and paths to shade.
struct WaitingTreelet {
  TreeletId treelet = kNoIndex;
  uint32_t waiting = 0;  ///< at least 1
  bool resident = false;
};

struct PolicyOptions {
  uint32_t queue_capacity = 4096;  ///< full: a queue is flushed when so many rays and paths wait
  uint32_t minimum_batch = 64;     ///< resident-first: smaller ones wait while one of four times their size is resident
  uint32_t drains = 32;            ///< treelets to drain of a decision, at most; at least 1
  uint32_t loads = 64;             ///< treelets to load of a decision, at most; 0: nothing can be read ahead
  /// resident-first: while so many rays wait in memory nothing more is read ahead, so that more gather first. 0: a
  /// quarter of the paths in flight, at least 16384 (scaled_policy, engine/treelet_scheduler.cpp).
  uint32_t rays_ahead = 0;
};

struct Decision {
  std::vector<TreeletId> drain;  ///< in this order; a treelet that is not resident is read by who drains it
  std::vector<TreeletId> load;   ///< to be read ahead, most wanted first; none of them is resident
  uint64_t rays_in_memory = 0;   ///< that wait for resident treelets
  uint64_t load_below_rays = ~0ull;  ///< loads begin when fewer rays are left in memory
};

class DrainPolicy {
 public:
  virtual ~DrainPolicy() = default;
  /// `work`: every treelet with work, by id. `more_coming`: new camera rays can still be admitted, so a policy may
  /// prefer to wait; when false and nothing can be loaded ahead it must drain a treelet if any has work.
  /// Writes `decision`, which comes empty.
  virtual void decide(std::span<const WaitingTreelet> work, bool more_coming, Decision& decision) = 0;
};

/// fullest, sweep, resident-first, full.
std::span<const std::string_view> drain_policy_names();
/// nullptr for an unknown name.
std::unique_ptr<DrainPolicy> make_drain_policy(std::string_view name, const PolicyOptions& options);

std::unique_ptr<DrainPolicy> make_fullest_policy(const PolicyOptions& options);
std::unique_ptr<DrainPolicy> make_sweep_policy(const PolicyOptions& options);
std::unique_ptr<DrainPolicy> make_resident_first_policy(const PolicyOptions& options);
std::unique_ptr<DrainPolicy> make_full_policy(const PolicyOptions& options);

}  // namespace shoal
