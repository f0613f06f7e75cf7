#include "bench/ray_sort.h"

#include "io/result.h"

namespace shoal::bench {
namespace {

constexpr uint32_t kAxisBits = 11;

/// The lower 11 bits of `x`, two empty bits after each.
uint64_t spread(uint64_t x) {
  x = (x | (x << 16)) & 0x0000ff0000ffull;
  x = (x | (x << 8)) & 0x00f00f00f00full;
  x = (x | (x << 4)) & 0x0c30c30c30c3ull;
  return (x | (x << 2)) & 0x249249249249ull;
}

}  // namespace

RaySorter::RaySorter(const Bounds3& bounds, unsigned threads, uint64_t ray_count)
    : lo_(bounds.lo),
      scale_(static_cast<float>(1u << kAxisBits) / glm::max(bounds.extent(), Vec3(1e-30f))),
      threads_(threads),
      barrier_(threads),
      items_(ray_count),
      scattered_(ray_count),
      histograms_(threads, std::vector<uint64_t>(kDigits)) {
  SHOAL_CHECK(ray_count < (1u << kIndexBits));
}

uint64_t RaySorter::key_of(const BenchRay& ray) const {
  uint64_t morton = 0, octant = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const float cell = (ray.origin[axis] - lo_[axis]) * scale_[axis];
    const float last = static_cast<float>((1u << kAxisBits) - 1);
    morton |= spread(static_cast<uint64_t>(std::min(std::max(cell, 0.0f), last))) << axis;
    octant |= (ray.direction[axis] < 0 ? 1ull : 0ull) << axis;
  }
  return morton << 3 | octant;
}

void RaySorter::scatter(uint32_t shift, unsigned thread, uint64_t first, uint64_t last) {
  std::vector<uint64_t>& own = histograms_[thread];
  std::fill(own.begin(), own.end(), 0);
  for (uint64_t i = first; i < last; ++i) ++own[(items_[i] >> shift) & (kDigits - 1)];
  barrier_.arrive_and_wait();
  uint64_t place[kDigits], next = 0;
  for (uint32_t digit = 0; digit < kDigits; ++digit) {
    for (unsigned t = 0; t < threads_; ++t) {
      if (t == thread) place[digit] = next;
      next += histograms_[t][digit];
    }
  }
  for (uint64_t i = first; i < last; ++i) scattered_[place[(items_[i] >> shift) & (kDigits - 1)]++] = items_[i];
  barrier_.arrive_and_wait();
}

void RaySorter::sort(std::span<const BenchRay> rays, unsigned thread) {
  const uint64_t first = rays.size() * thread / threads_, last = rays.size() * (thread + 1) / threads_;
  for (uint64_t i = first; i < last; ++i) items_[i] = key_of(rays[i]) << kIndexBits | i;
  for (uint32_t pass = 0; pass < kPasses; ++pass) {
    scatter(kIndexBits + pass * kDigitBits, thread, first, last);
    if (thread == 0) items_.swap(scattered_);
    barrier_.arrive_and_wait();
  }
}

}  // namespace shoal::bench
