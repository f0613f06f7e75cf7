// Sorts rays by where they begin, then by the octant they go to: a key of 33 bits of Morton code of the origin, in the
// scene's box, and 3 signs of the direction. Least significant digits first, stable, in parallel. The buffers are kept.
// Called by the threads of a team together (bench/thread_team.h). Cost: three passes over 8 bytes a ray.
#pragma once

#include <barrier>
#include <span>
#include <vector>

#include "bench/memory_orders.h"

namespace shoal::bench {

class RaySorter {
 public:
  /// Requires: ray_count < 2^28.
  RaySorter(const Bounds3& bounds, unsigned threads, uint64_t ray_count);

  /// Called by each of the threads once; returns when all are done.
  void sort(std::span<const BenchRay> rays, unsigned thread);
  /// The index of the ray that comes `place`-th. Requires: sort() has returned.
  uint32_t ray_at(uint64_t place) const { return static_cast<uint32_t>(items_[place] & ((1u << kIndexBits) - 1)); }

 private:
  static constexpr uint32_t kIndexBits = 28, kDigitBits = 12, kPasses = 3;
  static constexpr uint32_t kDigits = 1u << kDigitBits;

  uint64_t key_of(const BenchRay& ray) const;
  void scatter(uint32_t shift, unsigned thread, uint64_t first, uint64_t last);

  Vec3 lo_, scale_;
  unsigned threads_;
  std::barrier<> barrier_;
  LargeVector<uint64_t> items_, scattered_;       ///< key above, index of the ray below
  std::vector<std::vector<uint64_t>> histograms_;  ///< a thread, a digit
};

}  // namespace shoal::bench
