#include "bench/touched_group.h"

namespace shoal::bench {

void TouchedGroup::address(const TopTree& tree) {
  NextJob jobs[kCapacity];
  uint8_t slots[kCapacity];
  uint32_t count = 0;
  for (uint32_t i = 0; i < size_; ++i) {
    GroupRay& member = rays_[slot_[i]];
    log_.read(member.page, TouchKind::kInHand);
    if (member.page != nullptr) continue;
    entry_[slot_[i]] = kNoIndex;
    if (member.ray.any_hit() && member.ray.hit.valid()) continue;
    jobs[count] = {&member.ray, &member.context};
    slots[count++] = slot_[i];
  }
  log_.write(jobs, count * sizeof(NextJob), TouchKind::kInHand);
  next_entries_touching(tree, {jobs, count}, log_);
  for (uint32_t k = 0; k < count; ++k) {
    entry_[slots[k]] = jobs[k].entry;
    rays_[slots[k]].node_tests += jobs[k].node_tests;
  }
}

void TouchedGroup::trace(const TopTree& tree, TraceCounters& counters) {
  TraceJob jobs[kCapacity];
  for (uint32_t i = 0; i < size_; ++i) {
    GroupRay& member = rays_[slot_[i]];
    const uint32_t cursor = member.ray.cursor;
    const uint32_t& entry = tree.nodes()[cursor >> 3].child[cursor & 7];
    log_.read(entry, TouchKind::kTopTree);
    log_.read(tree.entry(entry), TouchKind::kTopTree);
    jobs[i] = {member.page, &member.ray, &member.context, &tree.instance(member.ray.instance),
               tree.current(member.ray)};
  }
  log_.write(jobs, size_ * sizeof(TraceJob), TouchKind::kInHand);
  trace_treelets_touching({jobs, size_}, counters, log_);
  for (uint32_t i = 0; i < size_; ++i) {
    GroupRay& member = rays_[slot_[i]];
    log_.write(member.page, TouchKind::kInHand);
    member.node_tests += jobs[i].node_tests;
    member.triangle_tests += jobs[i].triangle_tests;
    member.page = nullptr;
    member.traced = true;
  }
}

}  // namespace shoal::bench
