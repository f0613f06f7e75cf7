// What the kernels touch at each step, told to their meter; empty with NoTouches. Included once a target
// (foreach_target.h).
#if defined(SHOAL_TREELETS_TOUCH_KERNEL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SHOAL_TREELETS_TOUCH_KERNEL_INL_H
#undef SHOAL_TREELETS_TOUCH_KERNEL_INL_H
#else
#define SHOAL_TREELETS_TOUCH_KERNEL_INL_H
#endif

#include <bit>

#include "treelets/box_kernel-inl.h"
#include "treelets/leaf_kernel-inl.h"
#include "treelets/ray_space.h"
#include "treelets/touch_log.h"
#include "treelets/trace_treelet.h"
#include "treelets/treelet_view.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

template <class Meter>
HWY_INLINE void touch_read(const Meter& meter, const void* at, size_t bytes, TouchKind kind) {
  if constexpr (Meter::kMeters) meter.log->read(at, bytes, kind);
}

template <class Meter>
HWY_INLINE void touch_write(const Meter& meter, const void* at, size_t bytes, TouchKind kind) {
  if constexpr (Meter::kMeters) meter.log->write(at, bytes, kind);
}

/// So many lines from `at` on are asked for.
template <class Meter>
HWY_INLINE void touch_ahead(const Meter& meter, const std::byte* at, int lines, TouchKind kind) {
  if constexpr (Meter::kMeters) {
    for (int line = 0; line < lines; ++line) meter.log->prefetch(at + 64 * line, kind);
  }
}

/// The ray's space in `context`: read where it is ready, else made.
template <class Meter>
HWY_INLINE void touch_space(const Meter& meter, const Ray& ray, const Instance& instance, RayContext& context) {
  if constexpr (Meter::kMeters) {
    meter.log->read(context.object_instance, TouchKind::kInHand);
    if (context.object_instance == ray.instance) return meter.log->read(context.object, TouchKind::kInHand);
    if (instance.identity == 0) meter.log->read(instance, TouchKind::kTopTree);
    meter.log->read(&instance.identity, 16, TouchKind::kTopTree);
    meter.log->write(context.object, TouchKind::kInHand);
  }
}

template <class Meter>
HWY_INLINE void touch_job(const Meter& meter, TraceJob& job) {
  if constexpr (Meter::kMeters) {
    meter.log->write(job, TouchKind::kInHand);
    meter.log->write(*job.ray, TouchKind::kInHand);
    touch_space(meter, *job.ray, *job.instance, *job.context);
  }
}

/// Of a lane `lane_bytes` stand before its stack.
template <class Meter, class Lane>
HWY_INLINE void touch_header(const Meter& meter, const TreeletView& treelet, const Lane& lane, size_t lane_bytes) {
  if constexpr (Meter::kMeters) {
    meter.log->read(treelet.header->leaves_offset, TouchKind::kNodes);
    meter.log->write(&lane, lane_bytes, TouchKind::kInHand);
  }
}

/// What a test of boxes, or of a leaf, reads of the ray in hand, and where it counts.
template <class Meter, class Lane>
HWY_INLINE void touch_ray(const Meter& meter, const Lane& lane, const RaySpace& space, const Ray& ray,
                          const uint32_t& tests, bool boxes) {
  if constexpr (Meter::kMeters) {
    meter.log->read(&lane, 48, TouchKind::kInHand);  // the pointers at its start
    meter.log->read(ray.t, TouchKind::kInHand);
    meter.log->write(tests, TouchKind::kInHand);
    static_assert(offsetof(RaySpace, kx) - offsetof(RaySpace, slope) == 64);  // slope, both biases, negative
    const void* const from = boxes ? static_cast<const void*>(space.slope) : &space;
    meter.log->read(from, boxes ? 64 : sizeof space, TouchKind::kInHand);
  }
}

/// A node is tested; what is entered goes to the stack, 8 whatever the number.
template <class Meter, class Lane>
HWY_INLINE void touch_entered(const Meter& meter, const Lane& lane) {
  if constexpr (Meter::kMeters) {
    meter.log->write(lane.keys + lane.size, 8 * sizeof(uint32_t), TouchKind::kInHand);
    meter.log->write(lane.refs + lane.size, 8 * sizeof(uint32_t), TouchKind::kInHand);
  }
}

/// A node of a treelet is tested.
template <class Meter>
HWY_INLINE void touch_node(const Meter& meter, const QuantizedNode& node) {
  if constexpr (Meter::kMeters) {
    meter.log->read(node, TouchKind::kNodes);
    meter.log->lanes.nodes.add(node.child_count, 8);
  }
}

/// What is on top of the stack is looked at.
template <class Meter, class Lane>
HWY_INLINE void touch_pop(const Meter& meter, const Lane& lane) {
  if constexpr (Meter::kMeters) {
    meter.log->read(lane.keys[lane.size], TouchKind::kInHand);
    meter.log->read(lane.refs[lane.size], TouchKind::kInHand);
  }
}

/// Lanes that so many triangles take: whole vectors.
HWY_INLINE uint32_t lanes_of(uint32_t triangles) {
  return static_cast<uint32_t>((triangles + kLeafLanes - 1) / kLeafLanes * kLeafLanes);
}

/// What a test of a leaf reads: header, positions and corners, to the end of the last vector.
template <class Meter>
HWY_INLINE void touch_leaf(const Meter& meter, const LeafView& leaf) {
  if constexpr (Meter::kMeters) {
    const auto* end = reinterpret_cast<const std::byte*>(leaf.corner(2) + lanes_of(leaf.triangle_count));
    meter.log->read(leaf.leaf, static_cast<size_t>(end - leaf.leaf), TouchKind::kLeaves);
  }
}

/// find_candidates(): a lane a triangle.
template <class Meter>
HWY_INLINE void touch_candidates(const Meter& meter, const LeafView& leaf) {
  if constexpr (Meter::kMeters) {
    touch_leaf(meter, leaf);
    meter.log->lanes.leaves.add(leaf.triangle_count, lanes_of(leaf.triangle_count));
  }
}

/// The boxes of the children are tested.
template <class Meter>
HWY_INLINE void touch_top_boxes(const Meter& meter, const TopNode& node) {
  if constexpr (Meter::kMeters) {
    meter.log->read(node.lo, sizeof node.lo + sizeof node.hi, TouchKind::kTopTree);
    uint32_t children = 0;
    for (const ChildKind kind : node.kind) children += kind != ChildKind::kEmpty ? 1 : 0;
    meter.log->lanes.top_nodes.add(children, 8);
  }
}

/// A node of the top tree is tested by a tracer with a stack.
template <class Meter>
HWY_INLINE void touch_top_node(const Meter& meter, const TopNode& node) {
  if constexpr (Meter::kMeters) {
    touch_top_boxes(meter, node);
    meter.log->read(node.child, sizeof node - offsetof(TopNode, child), TouchKind::kTopTree);
  }
}

/// A packet tests a node or a leaf for `rays`, a bit each, of `lanes`.
template <class Meter, class Packet>
HWY_INLINE void touch_packet(const Meter& meter, const Packet& packet, uint32_t rays, uint32_t lanes) {
  if constexpr (Meter::kMeters) {
    meter.log->read(&packet, offsetof(Packet, rays), TouchKind::kInHand);
    meter.log->lanes.packets.add(static_cast<uint32_t>(std::popcount(rays)), lanes);
  }
}

/// A walk through the top tree begins, or goes on.
template <class Meter, class Lane>
HWY_INLINE void touch_walk(const Meter& meter, NextJob& job, const Lane& lane) {
  if constexpr (Meter::kMeters) {
    meter.log->write(job, TouchKind::kInHand);
    meter.log->write(lane, TouchKind::kInHand);
    meter.log->write(*job.ray, TouchKind::kInHand);
    const RayContext& context = *job.context;
    meter.log->read(context.object_instance, TouchKind::kInHand);
    if (job.ray->instance != kNoIndex && context.object_instance == job.ray->instance) {
      meter.log->read(context.object, TouchKind::kInHand);
    } else {
      meter.log->write(context.object, TouchKind::kInHand);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#endif
