#include "bench/touched_sort.h"

#include "bench/ray_sort.h"

namespace shoal::bench {
namespace {

// As in queues/ray_sorter.
constexpr uint32_t kAxisBits = 11, kSlotBits = 28, kDigitBits = 12, kDigits = 1u << kDigitBits;

/// RaySorter::key_of(); Morton code of the cell and octant of the direction.
class SortKey {
 public:
  explicit SortKey(const Bounds3& bounds)
      : lo_(bounds.lo), scale_(static_cast<float>(1u << kAxisBits) / glm::max(bounds.extent(), Vec3(1e-30f))) {}

  uint64_t of(const BenchRay& ray) const {
    uint64_t morton = 0, octant = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const float cell = (ray.origin[axis] - lo_[axis]) * scale_[axis];
      const uint64_t bits = cell > 0 ? static_cast<uint64_t>(std::min(cell, float{(1u << kAxisBits) - 1})) : 0;
      for (uint32_t bit = 0; bit < kAxisBits; ++bit) {
        morton |= (bits >> bit & 1) << (3 * bit + static_cast<uint32_t>(axis));
      }
      octant |= (ray.direction[axis] < 0 ? 1ull : 0ull) << axis;
    }
    return morton << 3 | octant;
  }

 private:
  Vec3 lo_, scale_;
};

}  // namespace

TouchedSort::TouchedSort(const Bounds3& bounds, const LargeVector<BenchRay>& rays, TouchLog& log)
    : count_(rays.size()), items_(rays.size()), sorted_(rays.size()) {
  const SortKey key(bounds);
  for (uint64_t i = 0; i < count_; ++i) log.write(items_[i], TouchKind::kSorting);  // emptied first
  for (uint64_t i = 0; i < count_; ++i) {
    log.read(rays[i], TouchKind::kGivenRays);
    items_[i] = key.of(rays[i]) << kSlotBits | i;
    log.write(items_[i], TouchKind::kSorting);
  }
  for (uint32_t i = 0; i < RaySorter::kPasses; ++i) {
    pass(i % 2 == 0 ? items_ : sorted_, i % 2 == 0 ? sorted_ : items_, kSlotBits + i * kDigitBits, log);
  }
  TeamSorter sorter(bounds, 1, count_);
  sorter.sort(rays, 0);
  for (uint64_t i = 0; i < count_; ++i) SHOAL_CHECK(sorter.ray_at(i) == slot_at(i));
}

uint32_t TouchedSort::slot_at(uint64_t place) const {
  return static_cast<uint32_t>(sorted_[place] & (RaySorter::kMaxSlots - 1));
}

void TouchedSort::pass(const HugeArray<uint64_t>& from, const HugeArray<uint64_t>& to, uint32_t shift,
                       TouchLog& log) {
  std::vector<uint32_t> digits(kDigits), places(kDigits);
  for (uint64_t i = 0; i < count_; ++i) {
    uint32_t& digit = digits[from[i] >> shift & (kDigits - 1)];
    ++digit;
    log.read(from[i], TouchKind::kSorting);
    log.write(digit, TouchKind::kSorting);
  }
  for (uint32_t digit = 0, next = 0; digit < kDigits; next += digits[digit++]) places[digit] = next;
  for (uint64_t i = 0; i < count_; ++i) {
    uint32_t& place = places[from[i] >> shift & (kDigits - 1)];
    log.read(from[i], TouchKind::kSorting);
    log.write(place, TouchKind::kSorting);
    log.write(to[place], TouchKind::kSorting);
    to[place++] = from[i];
  }
}

}  // namespace shoal::bench
