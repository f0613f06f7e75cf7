// The sorter of the sorted order (queues/ray_sorter.h), for a team of threads and all rays of a set at once. The
// buffers are kept. Called by the threads of a team together (bench/thread_team.h).
#pragma once

#include <barrier>
#include <span>

#include "bench/memory_orders.h"
#include "queues/ray_sorter.h"

namespace shoal::bench {

class TeamSorter {
 public:
  /// Requires: ray_count < RaySorter::kMaxSlots.
  TeamSorter(const Bounds3& bounds, unsigned threads, uint64_t ray_count)
      : sorter_(bounds, threads, ray_count), threads_(threads), barrier_(threads) {}

  /// Called by each of the threads once; returns when all are done.
  void sort(std::span<const BenchRay> rays, unsigned thread);
  /// The index of the ray that comes `place`-th. Requires: sort() has returned.
  uint32_t ray_at(uint64_t place) const { return sorter_.slot_at(place); }

 private:
  RaySorter sorter_;
  unsigned threads_;
  std::barrier<> barrier_;
};

}  // namespace shoal::bench
