#include "bench/ray_sort.h"

namespace shoal::bench {

void TeamSorter::sort(std::span<const BenchRay> rays, unsigned thread) {
  sorter_.clear(thread);
  barrier_.arrive_and_wait();
  const uint64_t first = rays.size() * thread / threads_, last = rays.size() * (thread + 1) / threads_;
  for (uint64_t i = first; i < last; ++i) sorter_.set(i, rays[i].origin, rays[i].direction);
  barrier_.arrive_and_wait();
  for (uint32_t pass = 0; pass < RaySorter::kPasses; ++pass) {
    sorter_.count(pass, thread);
    barrier_.arrive_and_wait();
    sorter_.scatter(pass, thread);
    barrier_.arrive_and_wait();
  }
}

}  // namespace shoal::bench
