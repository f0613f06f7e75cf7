// Which resident page leaves first: one policy a file behind this one-method interface. Called by the page cache under
// its lock, once a page and ranking. A policy sees numbers and returns one; it moves nothing.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string_view>

#include "io/page_file.h"

namespace shoal {

/// The demand for a page, in units of work (rays and paths): what waits for it, and what usually does.
struct PageDemand {
  PageDemand() = default;
  PageDemand(uint64_t waiting_now, uint64_t usual_batch = 0) : waiting(waiting_now), usual(usual_batch) {}
  uint64_t waiting = 0;  ///< waits for it now
  uint64_t usual = 0;    ///< the usual batch: what gathered before its drains, as a rule; 0: not known
};

/// Called under the cache's lock when it evicts. Must not call back.
using WaitingWork = std::function<PageDemand(PageId)>;

class EvictionPolicy {
 public:
  virtual ~EvictionPolicy() = default;
  /// The page with the smallest rank goes first; equal ones by least recent use. `last_use`: stamp of the last load or
  /// pin, of a clock that each load moves on.
  virtual uint64_t rank(const PageDemand& demand, uint64_t last_use) const = 0;
  /// A page is read ahead into the room of this one only when more work than this waits for it.
  virtual uint64_t worth(const PageDemand& demand) const { return demand.waiting; }
};

/// least-demand, least-waiting, least-recent.
std::span<const std::string_view> eviction_policy_names();
/// nullptr for an unknown name.
std::unique_ptr<EvictionPolicy> make_eviction_policy(std::string_view name);

std::unique_ptr<EvictionPolicy> make_least_waiting_eviction();
std::unique_ptr<EvictionPolicy> make_least_demand_eviction();
std::unique_ptr<EvictionPolicy> make_least_recent_eviction();

}  // namespace shoal
