// queues/ray_sorter over again, by one thread and for all rays of a set at once, with what it touches told to a
// TouchLog. Called by bench/touched_orders. Cost: its own memory (16 bytes a ray), and for a moment that of a
// RaySorter, whose order it is compared with.
#pragma once

#include "bench/memory_orders.h"
#include "bench/touch_meter.h"

namespace shoal::bench {

class TouchedSort {
 public:
  /// Ends the program where RaySorter has another order: then this must be brought up to date.
  TouchedSort(const Bounds3& bounds, const LargeVector<BenchRay>& rays, TouchLog& log);

  /// The index of the ray that comes `place`-th.
  uint32_t ray_at(uint64_t place, TouchLog& log) const {
    log.read(sorted_[place], TouchKind::kSorting);
    return slot_at(place);
  }

 private:
  uint32_t slot_at(uint64_t place) const;
  void pass(const HugeArray<uint64_t>& from, const HugeArray<uint64_t>& to, uint32_t shift, TouchLog& log);

  uint64_t count_;
  HugeArray<uint64_t> items_, sorted_;
};

}  // namespace shoal::bench
