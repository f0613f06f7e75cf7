// Rays that a thread has in hand together, so that the kernels trace several at once: each goes from treelet to treelet
// until the render loop lets it go. Called by engine/render_queued and engine/render_depth_first; one a thread.
//
// Properties and assumptions
//   memory     fixed: 64 rays and what is prepared of them (about 30 KiB).
//   order      none promised; rays do not affect each other.
#pragma once

#include <cstdint>

#include "treelets/ray_space.h"
#include "treelets/trace_treelet.h"

namespace shoal {

class TouchLog;

struct GroupRay {
  Ray ray;
  RayContext context;
  const std::byte* page;  ///< of the treelet that it stands on; none: it must be addressed first
  bool traced;            ///< through a treelet, since it was added
  uint32_t node_tests, triangle_tests;
};

class RayGroup {
 public:
  static constexpr uint32_t kCapacity = 64;

  RayGroup() { clear(); }
  uint32_t size() const { return size_; }
  bool full() const { return size_ == kCapacity; }
  void clear() {
    size_ = 0;
    for (uint32_t i = 0; i < kCapacity; ++i) slot_[i] = static_cast<uint8_t>(i);
  }

  /// Adds a ray; `page` is that of the treelet that its cursor stands on, or none when it has no cursor yet.
  /// Returns its slot, which is its own until it leaves. Requires: not full().
  uint32_t add(const Ray& ray, const std::byte* page) {
    const uint32_t slot = slot_[size_++];
    GroupRay& member = rays_[slot];
    member.ray = ray;
    member.context.reset();
    member.page = page;
    member.traced = false;
    member.node_tests = member.triangle_tests = 0;
    return slot;
  }

  /// A ray of the group; one that left, until the next is added.
  const GroupRay& ray(uint32_t slot) const { return rays_[slot]; }

  /// `look(ray)` at every ray.
  template <class Look>
  void each(const Look& look) const {
    for (uint32_t i = 0; i < size_; ++i) look(rays_[slot_[i]].ray);
  }

  /// Every ray goes on by one treelet: address, send, trace. Returns the number of rays traced.
  template <class Decide>
  uint32_t step(const TopTree& tree, TraceCounters& counters, const Decide& decide,
                TriangleTest test = TriangleTest::kWatertight) {
    address(tree);
    send(tree, decide);
    return trace(tree, counters, test);
  }

  /// Finds the next entry of every ray that stands on none.
  void address(const TopTree& tree, TouchLog* touches = nullptr);
  /// `decide(slot, member, treelet)` is told where a ray that was addressed wants to go (kNoIndex: its answer is known)
  /// and returns the treelet's page to trace it there now, or nothing: the ray has left.
  template <class Decide>
  void send(const TopTree& tree, const Decide& decide) {
    uint32_t kept = 0;
    for (uint32_t i = 0; i < size_; ++i) {
      const uint8_t slot = slot_[i];
      GroupRay& member = rays_[slot];
      if (member.page == nullptr) {
        const uint32_t entry = entry_[slot];
        member.page = decide(slot, member, entry == kNoIndex ? kNoIndex : tree.entry(entry).treelet);
        if (member.page == nullptr) continue;
      }
      std::swap(slot_[i], slot_[kept++]);
    }
    size_ = kept;
  }
  /// Traces every ray through the treelet that it stands on. Returns their number.
  /// `touches`: told what is touched, here and in address(); only by TriangleTest::kWatertight and InnerLoop::kMoreNumerous.
  uint32_t trace(const TopTree& tree, TraceCounters& counters, TriangleTest test,
                 InnerLoop loop = InnerLoop::kMoreNumerous, TouchLog* touches = nullptr);

 private:
  uint32_t size_;
  uint8_t slot_[kCapacity];  ///< first those of the rays, then the free ones
  uint32_t entry_[kCapacity];
  GroupRay rays_[kCapacity];
};

}  // namespace shoal
