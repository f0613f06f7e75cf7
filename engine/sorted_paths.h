// The paths in flight of a sorted render: their states, a slot for each of their two rays, and the order of the wave.
//
// Properties and assumptions
//   capacity   fixed at construction: `path_count` paths.
//   slots      of path p: 2p for the ray that goes on, 2p + 1 for the shadow ray. A path whose slots are both empty is
//              free, once the wave has ended. A slot is read before its path is shaded, and written after.
//   threads    any number; a path belongs to the thread that handles its last ray.
#pragma once

#include <memory>

#include "engine/path_state.h"
#include "engine/path_ray.h"
#include "engine/pause_gate.h"
#include "io/huge_memory.h"
#include "queues/ray_sorter.h"

namespace shoal {

class SortedPaths final : public UnfinishedPaths {
 public:
  SortedPaths(const Bounds3& bounds, uint32_t path_count, unsigned threads)
      : sorter(bounds, threads, 2ull * path_count), states_(path_count), rays_(2ull * path_count),
        path_count_(path_count) {
    for (unsigned part = 0; part < threads; ++part) sorter.clear(part);
  }

  static uint64_t bytes(uint32_t path_count, unsigned threads) {
    return state_bytes(path_count) + 2ull * path_count * sizeof(Ray) + RaySorter::bytes(threads, 2ull * path_count);
  }
  /// Of `bytes`, what is not rays and their order.
  static uint64_t state_bytes(uint32_t path_count) { return uint64_t{path_count} * sizeof(PathState); }

  PathState& state(uint32_t path) { return states_[path]; }
  uint32_t path_count() const { return path_count_; }
  bool free(uint32_t path) const { return sorter.empty(2ull * path) && sorter.empty(2ull * path + 1); }

  void each_unfinished(const VisitUnfinished& visit) const override {
    for (uint32_t path = 0; path < path_count_; ++path) visit_unfinished(states_[path], visit);
  }

  /// The ray joins the next wave. `touches`, here and below: told what is touched, when somebody measures.
  void put(const Ray& ray, TouchLog* touches = nullptr) {
    const uint64_t slot = 2ull * path_index_of(ray) + (ray.any_hit() ? 1 : 0);
    rays_[slot] = ray;
    if (touches != nullptr) [[unlikely]] {
      touches->write(rays_[slot], TouchKind::kQueues);
      sorter.touch_item(slot, *touches);
    }
    sorter.set(slot, ray.origin, ray.direction);
  }
  /// The ray of this wave that comes `place`-th.
  const Ray& ray_at(uint64_t place, TouchLog* touches = nullptr) const {
    if (touches != nullptr) [[unlikely]] sorter.touch_place(place, *touches);
    return rays_[sorter.slot_at(place)];
  }
  /// Asks for the memory of that ray and of its path, which are anywhere.
  void prefetch(uint64_t place) const {
    const uint32_t slot = sorter.slot_at(place);
    __builtin_prefetch(&rays_[slot]);
    const auto* bytes = reinterpret_cast<const std::byte*>(&states_[slot / 2]);
    __builtin_prefetch(bytes, 1);
    __builtin_prefetch(bytes + sizeof(PathState) - 1, 1);
  }

  RaySorter sorter;

 private:
  HugeArray<PathState> states_;
  HugeArray<Ray> rays_;
  uint32_t path_count_;
};

}  // namespace shoal
