#include "queues/ray_sorter.h"

#include <algorithm>

#include "io/result.h"

namespace shoal {
namespace {

constexpr uint32_t kAxisBits = 11;

/// The lower 11 bits of `x`, two empty bits after each.
uint64_t spread(uint64_t x) {
  x = (x | (x << 16)) & 0x0000ff0000ffull;
  x = (x | (x << 8)) & 0x00f00f00f00full;
  x = (x | (x << 4)) & 0x0c30c30c30c3ull;
  return (x | (x << 2)) & 0x249249249249ull;
}

/// Histograms and the stack's places are left out: they stay in the innermost caches.
void touch_range(const uint64_t* items, uint64_t first, uint64_t last, TouchAction action, TouchLog* touches) {
  if (touches == nullptr) return;
  constexpr uint64_t kAtOnce = 1 << 20;
  for (; first < last; first += kAtOnce) {
    touches->add(items + first, std::min(kAtOnce, last - first) * sizeof(uint64_t), TouchKind::kSorting, action);
  }
}

}  // namespace

RaySorter::RaySorter(const Bounds3& bounds, unsigned parts, uint64_t slots)
    : lo_(bounds.lo),
      scale_(static_cast<float>(1u << kAxisBits) / glm::max(bounds.extent(), Vec3(1e-30f))),
      parts_(parts),
      slots_(slots),
      items_(slots),
      sorted_(slots),
      histograms_(std::make_unique<Histogram[]>(parts)) {
  SHOAL_CHECK(slots < kMaxSlots);
}

uint64_t RaySorter::key_of(const Vec3& origin, const Vec3& direction) const {
  uint64_t morton = 0, octant = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const float cell = (origin[axis] - lo_[axis]) * scale_[axis];
    const float last = static_cast<float>((1u << kAxisBits) - 1);
    morton |= spread(cell > 0 ? static_cast<uint64_t>(std::min(cell, last)) : 0) << axis;
    octant |= (direction[axis] < 0 ? 1ull : 0ull) << axis;
  }
  return morton << 3 | octant;
}

RaySorter::Range RaySorter::range(uint32_t pass, unsigned part) const {
  const uint64_t all = pass == 0 ? slots_ : size();
  return {all * part / parts_, all * (part + 1) / parts_};
}

void RaySorter::clear(unsigned part, TouchLog* touches) {
  const Range slots = range(0, part);
  touch_range(items_.data(), slots.first, slots.last, TouchAction::kWrite, touches);
  std::fill(items_.data() + slots.first, items_.data() + slots.last, kEmpty);
}

uint64_t RaySorter::size() const {
  uint64_t sum = 0;
  for (unsigned part = 0; part < parts_; ++part) sum += histograms_[part].total;
  return sum;
}

void RaySorter::count(uint32_t pass, unsigned part, TouchLog* touches) {
  const Range places = range(pass, part);
  const uint64_t* const from = source(pass);
  touch_range(from, places.first, places.last, TouchAction::kRead, touches);
  Histogram& own = histograms_[part];
  std::fill(std::begin(own.digits), std::end(own.digits), 0);
  uint64_t total = 0;
  for (uint64_t i = places.first; i < places.last; ++i) {
    if (pass == 0 && from[i] == kEmpty) continue;
    ++own.digits[digit_of(from[i], pass)];
    ++total;
  }
  if (pass == 0) own.total = total;
}

void RaySorter::scatter(uint32_t pass, unsigned part, TouchLog* touches) {
  uint32_t place[kDigits], next = 0;
  for (uint32_t digit = 0; digit < kDigits; ++digit) {
    for (unsigned p = 0; p < parts_; ++p) {
      if (p == part) place[digit] = next;
      next += histograms_[p].digits[digit];
    }
  }
  const Range places = range(pass, part);
  const uint64_t* const from = source(pass);
  uint64_t* const to = target(pass);
  for (uint64_t i = places.first; i < places.last; ++i) {
    if (pass == 0 && from[i] == kEmpty) continue;
    uint64_t& item = to[place[digit_of(from[i], pass)]++];
    item = from[i];
    if (touches != nullptr) [[unlikely]] {
      touches->read(from[i], TouchKind::kSorting);
      touches->write(item, TouchKind::kSorting);
    }
  }
}

}  // namespace shoal
