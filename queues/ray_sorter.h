// Sorts rays by where they begin, then by the octant they go to: a key of 33 bits of Morton code of the origin, in the
// scene's box, and 3 signs of the direction. Least significant digits first, so stable: rays with one key stay in the
// order of their slots. Called by engine/render_sorted and bench/memory_orders, a wave at a time:
//
//   clear(part)                                 every slot is empty
//   set(slot, ray)                              ... but those of the wave
//   for each of kPasses: count(pass, part), then scatter(pass, part)
//   slot_at(place), place < size()              the sorted slots, until the next count(); slots may be set anew
//
// Properties and assumptions
//   touches    told what is touched, when somebody measures.
//   threads    `part` is 0 .. parts-1: any threads, each part once a step; a step ends before the next begins. set()
//              from any thread, no slot from two.
//   memory     fixed: 16 bytes a slot, 16 KiB a part.
//   cost       three passes over 8 bytes a ray, the first also over empty slots.
#pragma once

#include <memory>

#include "io/huge_memory.h"
#include "treelets/touch_log.h"
#include "treelets/vector.h"

namespace shoal {

class RaySorter {
 public:
  static constexpr uint32_t kPasses = 3;
  static constexpr uint64_t kMaxSlots = 1u << 28;

  /// Requires: slots < kMaxSlots.
  RaySorter(const Bounds3& bounds, unsigned parts, uint64_t slots);
  static uint64_t bytes(unsigned parts, uint64_t slots) {
    return 2 * slots * sizeof(uint64_t) + parts * sizeof(Histogram);
  }

  void clear(unsigned part, TouchLog* touches = nullptr);
  void set(uint64_t slot, const Vec3& origin, const Vec3& direction) {
    items_[slot] = key_of(origin, direction) << kSlotBits | slot;
  }
  bool empty(uint64_t slot) const { return items_[slot] == kEmpty; }

  void count(uint32_t pass, unsigned part, TouchLog* touches = nullptr);
  void scatter(uint32_t pass, unsigned part, TouchLog* touches = nullptr);

  /// Rays that were sorted. Requires: the first count() has ended.
  uint64_t size() const;
  uint32_t slot_at(uint64_t place) const { return static_cast<uint32_t>(sorted_[place] & (kMaxSlots - 1)); }
  /// What set() of the slot writes, and what slot_at() reads.
  void touch_item(uint64_t slot, TouchLog& touches) const { touches.write(items_[slot], TouchKind::kSorting); }
  void touch_place(uint64_t place, TouchLog& touches) const { touches.read(sorted_[place], TouchKind::kSorting); }

 private:
  static constexpr uint32_t kSlotBits = 28, kDigitBits = 12, kDigits = 1u << kDigitBits;
  static constexpr uint64_t kEmpty = ~0ull;  ///< no item: slot 2^28 - 1 is not used
  struct Histogram {
    uint32_t digits[kDigits];
    uint64_t total;  ///< rays among the part's slots
  };
  struct Range {
    uint64_t first, last;
  };

  uint64_t key_of(const Vec3& origin, const Vec3& direction) const;
  Range range(uint32_t pass, unsigned part) const;
  /// The first and the last pass go from items_ to sorted_, the one between goes back.
  const uint64_t* source(uint32_t pass) const { return (pass & 1) == 0 ? items_.data() : sorted_.data(); }
  uint64_t* target(uint32_t pass) const { return (pass & 1) == 0 ? sorted_.data() : items_.data(); }
  static uint32_t digit_of(uint64_t item, uint32_t pass) {
    return (item >> (kSlotBits + pass * kDigitBits)) & (kDigits - 1);
  }

  Vec3 lo_, scale_;
  unsigned parts_;
  uint64_t slots_;
  HugeArray<uint64_t> items_;   ///< by slot: key above, slot below; kEmpty: no ray
  HugeArray<uint64_t> sorted_;
  std::unique_ptr<Histogram[]> histograms_;  ///< a part
};

}  // namespace shoal
