// Pages that a thread holds for the rays of its group: one pin serves all rays that stand on a page, and stays until
// its place is wanted for another, so that a ray that follows finds it without asking the cache, whose counts of pins
// all threads write to. Called by engine/render_sorted, one a thread.
// render_depth_first shares its limit.
//
// Properties and assumptions
//   capacity   at most `limit` pages are held. Of as many rays each holds one at most, so there is always a place.
//   limit 1    nothing is held for later: the page goes with its ray, as the cache may have room for no other.
//   cost       a look over the places: at most 64 words.
#pragma once

#include <algorithm>

#include "engine/ray_group.h"
#include "io/page_cache.h"

namespace shoal {

/// How many rays a thread may have under way, each on a page that it holds. Where the cache has room for every page, as
/// many as it likes: `most`. Else pages of the largest kinds take at most an eighth of the cache, of all threads together,
/// so that the rest is left to what was used last. From 1 to `most`.
inline uint32_t rays_under_way(const PageCache& cache, const PageFile& file, unsigned threads, uint32_t most) {
  if (cache.capacity_bytes() >= PageCache::every_page_bytes(file)) return most;
  constexpr uint64_t kCacheParts = 8;
  const uint64_t share = cache.capacity_bytes() / (kCacheParts * threads);
  const uint64_t page = std::max<uint64_t>(PageCache::minimum_capacity_bytes(file, 1), 1);
  return static_cast<uint32_t>(std::clamp<uint64_t>(share / page, 1, most));
}

class HeldPages {
 public:
  /// Requires: 1 <= limit <= RayGroup::kCapacity.
  explicit HeldPages(uint32_t limit) : limit_(limit) { clear(); }

  /// The page that the ray in `slot` stands on, if that is of `treelet`.
  const std::byte* page(uint32_t slot, TreeletId treelet) const {
    const uint8_t place = place_of_[slot];
    return place != kNone && treelets_[place] == treelet ? pins_[place].bytes().data() : nullptr;
  }

  /// The page of `treelet` for the ray in `slot`, which lets go of what it held; `pin()` brings a page that is not
  /// held. None when that fails.
  template <class Pin>
  const std::byte* hold(uint32_t slot, TreeletId treelet, const Pin& pin) {
    release(slot);
    uint32_t place = 0;
    while (place < limit_ && treelets_[place] != treelet) ++place;
    if (place == limit_) {
      for (place = 0; rays_[place] > 0;) ++place;
      treelets_[place] = kNoIndex;
      pins_[place].reset();  // first: there may be no room for both
      pins_[place] = pin();
      if (!pins_[place]) return nullptr;
      treelets_[place] = treelet;
    }
    ++rays_[place];
    place_of_[slot] = static_cast<uint8_t>(place);
    return pins_[place].bytes().data();
  }

  /// The ray in `slot` leaves its page. Requires: it holds one, or none since it was released.
  void release(uint32_t slot) {
    const uint8_t place = place_of_[slot];
    if (place == kNone) return;
    place_of_[slot] = kNone;
    if (--rays_[place] == 0 && limit_ == 1) clear();
  }

  /// Lets go of everything, and forgets all rays.
  void clear() {
    for (PagePin& pin : pins_) pin.reset();
    std::fill_n(treelets_, RayGroup::kCapacity, kNoIndex);
    std::fill_n(rays_, RayGroup::kCapacity, 0);
    std::fill_n(place_of_, RayGroup::kCapacity, kNone);
  }

 private:
  static constexpr uint8_t kNone = 0xff;
  uint32_t limit_;
  TreeletId treelets_[RayGroup::kCapacity];
  uint32_t rays_[RayGroup::kCapacity];  ///< that stand on it
  PagePin pins_[RayGroup::kCapacity];
  uint8_t place_of_[RayGroup::kCapacity];  ///< by slot of the group
};

}  // namespace shoal
