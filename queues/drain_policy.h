// Which treelet is worked on next: one policy a file behind this interface. A policy sees numbers and returns a
// decision as a value; it moves nothing itself. Called by engine/render_queued under a lock, one choice at a time.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "treelets/ray.h"

namespace shoal {

/// What a policy may look at. `waiting` counts rays to trace and paths to shade of a treelet.
class WaitingView {
 public:
  virtual ~WaitingView() = default;
  virtual uint32_t treelet_count() const = 0;
  virtual uint32_t waiting(TreeletId treelet) const = 0;
  virtual bool resident(TreeletId treelet) const = 0;
};

struct PolicyOptions {
  uint32_t queue_capacity = 4096;  ///< full: a queue is flushed when so many wait
  uint32_t minimum_batch = 64;     ///< resident-first: smaller queues wait while larger ones exist
};

class DrainPolicy {
 public:
  virtual ~DrainPolicy() = default;
  /// The treelet to drain, or kNoIndex: nothing is worth it yet. `more_coming`: new camera rays can still be admitted,
  /// so a policy may prefer to wait; when false it must choose a treelet if any has work.
  virtual TreeletId choose(const WaitingView& view, bool more_coming) = 0;
};

/// fullest, sweep, resident-first, full.
std::span<const std::string_view> drain_policy_names();
/// nullptr for an unknown name.
std::unique_ptr<DrainPolicy> make_drain_policy(std::string_view name, const PolicyOptions& options);

std::unique_ptr<DrainPolicy> make_fullest_policy();
std::unique_ptr<DrainPolicy> make_sweep_policy();
std::unique_ptr<DrainPolicy> make_resident_first_policy(uint32_t minimum_batch);
std::unique_ptr<DrainPolicy> make_full_policy(uint32_t queue_capacity);

}  // namespace shoal
