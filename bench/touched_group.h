// engine/ray_group over again, with what it touches told to a TouchLog: the same rays go on together in the same
// order. Called by bench/touched_orders. One thread; some 30 KiB.
#pragma once

#include "bench/touch_meter.h"
#include "engine/ray_group.h"
#include "treelets/trace_touching.h"

namespace shoal::bench {

class TouchedGroup {
 public:
  static constexpr uint32_t kCapacity = RayGroup::kCapacity;

  explicit TouchedGroup(TouchLog& log) : log_(log) {
    for (uint32_t i = 0; i < kCapacity; ++i) slot_[i] = static_cast<uint8_t>(i);
  }
  uint32_t size() const { return size_; }
  bool full() const { return size_ == kCapacity; }

  /// As RayGroup::add(). Requires: not full().
  void add(const Ray& ray, const std::byte* page) {
    GroupRay& member = rays_[slot_[size_++]];
    member.ray = ray;
    member.context.reset();
    member.page = page;
    member.traced = false;
    member.node_tests = member.triangle_tests = 0;
    log_.write(member.ray, TouchKind::kInHand);
    log_.write(member.context.object_instance, TouchKind::kInHand);
    log_.write(member.page, TouchKind::kInHand);
  }

  /// As RayGroup::step(), with `decide(member, treelet)`.
  template <class Decide>
  uint32_t step(const TopTree& tree, TraceCounters& counters, const Decide& decide) {
    address(tree);
    uint32_t kept = 0;
    for (uint32_t i = 0; i < size_; ++i) {
      const uint8_t slot = slot_[i];
      GroupRay& member = rays_[slot];
      log_.write(member.page, TouchKind::kInHand);
      if (member.page == nullptr) {
        const uint32_t entry = entry_[slot];
        if (entry != kNoIndex) log_.read(tree.entry(entry), TouchKind::kTopTree);
        member.page = decide(member, entry == kNoIndex ? kNoIndex : tree.entry(entry).treelet);
        if (member.page == nullptr) continue;
      }
      std::swap(slot_[i], slot_[kept++]);
    }
    size_ = kept;
    trace(tree, counters);
    return kept;
  }

 private:
  void address(const TopTree& tree);
  void trace(const TopTree& tree, TraceCounters& counters);

  TouchLog& log_;
  uint32_t size_ = 0;
  uint8_t slot_[kCapacity];
  uint32_t entry_[kCapacity];
  GroupRay rays_[kCapacity];
};

}  // namespace shoal::bench
