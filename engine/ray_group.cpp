#include "engine/ray_group.h"

#include "treelets/trace_touching.h"

namespace shoal {
namespace {

/// Of a ray in the group: where it stands, and what it took.
void touch_member(const GroupRay& member, TouchLog& touches) {
  touches.write(member.page, TouchKind::kInHand);
  touches.write(member.triangle_tests, TouchKind::kInHand);
}

}  // namespace

void RayGroup::address(const TopTree& tree, TouchLog* touches) {
  NextJob jobs[kCapacity];
  uint8_t slots[kCapacity];
  uint32_t count = 0;
  for (uint32_t i = 0; i < size_; ++i) {
    GroupRay& member = rays_[slot_[i]];
    if (member.page != nullptr) continue;
    entry_[slot_[i]] = kNoIndex;
    if (member.ray.any_hit() && member.ray.hit.valid()) continue;
    jobs[count] = {&member.ray, &member.context};
    slots[count++] = slot_[i];
  }
  if (touches == nullptr) {
    tree.next({jobs, count});
  } else {
    for (uint32_t i = 0; i < size_; ++i) touch_member(rays_[slot_[i]], *touches);
    touches->write(jobs, count * sizeof(NextJob), TouchKind::kInHand);
    touches->write(entry_, sizeof entry_, TouchKind::kInHand);
    next_entries_touching(tree, {jobs, count}, *touches);
  }
  for (uint32_t k = 0; k < count; ++k) {
    entry_[slots[k]] = jobs[k].entry;
    rays_[slots[k]].node_tests += jobs[k].node_tests;
  }
}

uint32_t RayGroup::trace(const TopTree& tree, TraceCounters& counters, TriangleTest test, InnerLoop loop,
                         TouchLog* touches) {
  TraceJob jobs[kCapacity];
  for (uint32_t i = 0; i < size_; ++i) {
    GroupRay& member = rays_[slot_[i]];
    if (touches != nullptr) {
      touches->read(tree.nodes()[member.ray.cursor >> 3].child[member.ray.cursor & 7], TouchKind::kTopTree);
      touches->read(tree.current(member.ray), TouchKind::kTopTree);
    }
    jobs[i] = {member.page, &member.ray, &member.context, &tree.instance(member.ray.instance),
               tree.current(member.ray)};
  }
  if (touches == nullptr) {
    trace_treelets({jobs, size_}, counters, test, loop);
  } else {
    touches->write(jobs, size_ * sizeof(TraceJob), TouchKind::kInHand);
    trace_treelets_touching({jobs, size_}, counters, *touches, loop);
    for (uint32_t i = 0; i < size_; ++i) touch_member(rays_[slot_[i]], *touches);
  }
  for (uint32_t i = 0; i < size_; ++i) {
    GroupRay& member = rays_[slot_[i]];
    member.node_tests += jobs[i].node_tests;
    member.triangle_tests += jobs[i].triangle_tests;
    member.page = nullptr;
    member.traced = true;
  }
  return size_;
}

}  // namespace shoal
