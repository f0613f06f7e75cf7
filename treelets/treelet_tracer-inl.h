// Jobs through their treelets, several in turn, by one kind of triangle test: the loop behind trace_treelets(). Included
// once a target by trace_treelets.cpp and trace_other_kinds.cpp (foreach_target.h).
#if defined(SHOAL_TREELETS_TREELET_TRACER_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SHOAL_TREELETS_TREELET_TRACER_INL_H
#undef SHOAL_TREELETS_TREELET_TRACER_INL_H
#else
#define SHOAL_TREELETS_TREELET_TRACER_INL_H
#endif

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include "treelets/hit_kernel-inl.h"
#include "treelets/leaf_kernel-inl.h"
#include "treelets/leaf_test.h"
#include "treelets/node_kernel-inl.h"
#include "treelets/space_kernel-inl.h"
#include "treelets/touch_kernel-inl.h"
#include "treelets/trace_treelet.h"
#include "treelets/trace_treelet_scalar.h"

#ifndef SHOAL_TREELETS_TRACE_LANE
#define SHOAL_TREELETS_TRACE_LANE
namespace shoal {

/// Rays traced in turn: while one waits for memory or for a result the others go on. 16 was 3 % faster than 8, 32 no
/// faster (docs/decisions/0015).
inline constexpr uint32_t kTraceLanes = 16;
/// At each level of a treelet at most 7 siblings wait; 8 are written whatever the number.
inline constexpr uint32_t kLaneStack = 7 * kMaxTreeletDepth + 8;

/// A ray on its way through a treelet: what is still to visit, the nearest on top.
struct TraceLane {
  TraceJob* job;
  const RaySpace* space;
  const std::byte* leaves;
  const QuantizedNode* nodes;
  NodeRef ref;  ///< to visit now
  uint32_t size;
  uint32_t candidates;  ///< of the leaf `ref`
  uint32_t keys[kLaneStack];
  NodeRef refs[kLaneStack];

  LeafView leaf() const { return LeafView(leaves + size_t{4} * leaf_offset(ref)); }
};

}  // namespace shoal
#endif

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

class LaneList {
 public:
  uint32_t size() const { return size_; }
  uint32_t operator[](uint32_t i) const { return lanes_[i]; }
  void clear() { size_ = 0; }
  void add(uint32_t lane) { lanes_[size_++] = static_cast<uint8_t>(lane); }

 private:
  uint32_t size_ = 0;
  uint8_t lanes_[kTraceLanes];
};

/// `Meter`: NoTouches, or TouchMeter to tell what is touched (treelets/touch_log.h).
template <TriangleTest kTest, class Meter = NoTouches>
class Tracer {
 public:
  Tracer(std::span<TraceJob> jobs, TraceCounters& counters, Meter meter = {})
      : jobs_(jobs), counters_(counters), meter_(meter) {}

  HWY_INLINE void run() {
    for (uint32_t lane = 0; lane < kTraceLanes; ++lane) start(lane);
    for (;;) {
      if (waiting_[0].size() >= waiting_[1].size()) {
        if (waiting_[0].size() == 0) return;
        cross_nodes();
      } else {
        cross_leaves();
      }
    }
  }

 protected:
  /// Puts the next job into the lane, if there is one.
  HWY_INLINE void start(uint32_t index) {
    while (next_job_ < jobs_.size()) {
      TraceJob& job = jobs_[next_job_++];
      touch_job(meter_, job);
      const RaySpace& space = prepare(job);
      if (HWY_UNLIKELY(space.extreme)) {
        trace_treelet_scalar(job, counters_, kTest);
        continue;
      }
      TraceLane& lane = lanes_[index];
      const TreeletView treelet(job.page);
      touch_header(meter_, treelet, lane, sizeof(TraceLane) - sizeof lane.keys - sizeof lane.refs);
      lane.job = &job;
      lane.space = &space;
      lane.nodes = treelet.nodes;
      lane.leaves = job.page + treelet.header->leaves_offset;
      lane.ref = job.entry.root;
      lane.size = 0;
      return wait(index);
    }
  }

  static HWY_INLINE const RaySpace& prepare(const TraceJob& job) {
    RayContext& context = *job.context;
    const uint32_t instance = job.ray->instance;
    if (context.object_instance == instance) return context.object;
    if (job.instance->identity == 0) return context.object_space(*job.ray, *job.instance);
    prepare_identity(*job.ray, job.instance->max_abs_coordinate, context.object);
    context.object_instance = instance;
    return context.object;
  }

  /// The lane visits lane.ref when its turn comes.
  HWY_INLINE void wait(uint32_t index) {
    const TraceLane& lane = lanes_[index];
    // Chosen by arithmetic: as often a leaf as a node, a branch would be guessed wrong half the time.
    const uint32_t leaf = lane.ref >> 31;
    const uintptr_t mask = uintptr_t{0} - leaf;
    const uintptr_t leaf_at = reinterpret_cast<uintptr_t>(lane.leaves) + uintptr_t{4} * leaf_offset(lane.ref);
    const uintptr_t node_at = reinterpret_cast<uintptr_t>(lane.nodes) + sizeof(QuantizedNode) * uintptr_t{lane.ref};
    const auto* at = reinterpret_cast<const std::byte*>((leaf_at & mask) | (node_at & ~mask));
    for (int line = 0; line < 3; ++line) hwy::Prefetch(at + 64 * line);
    touch_ahead(meter_, at, 3, leaf != 0 ? TouchKind::kLeaves : TouchKind::kNodes);
    waiting_[leaf].add(index);
  }

  /// Goes on to the nearest of what is left, or to the next job.
  HWY_INLINE void go_on(uint32_t index) {
    TraceLane& lane = lanes_[index];
    const float t = lane.job->ray->t;
    while (lane.size > 0) {
      --lane.size;
      touch_pop(meter_, lane);
      if (key_t(lane.keys[lane.size]) > t) continue;
      lane.ref = lane.refs[lane.size];
      return wait(index);
    }
    start(index);
  }

  HWY_INLINE void cross_nodes() {
    const LaneList list = waiting_[0];
    waiting_[0].clear();
    for (uint32_t i = 0; i < list.size(); ++i) {
      TraceLane& lane = lanes_[list[i]];
      ++lane.job->node_tests;
      touch_ray(meter_, lane, *lane.space, *lane.job->ray, lane.job->node_tests, true);
      touch_node(meter_, lane.nodes[lane.ref]);
      touch_entered(meter_, lane);
      lane.size += enter_children(*lane.space, lane.nodes[lane.ref], lane.job->ray->t, lane.keys + lane.size,
                                  lane.refs + lane.size);
    }
    for (uint32_t i = 0; i < list.size(); ++i) go_on(list[i]);
  }

  HWY_INLINE void cross_leaves() {
    const LaneList list = waiting_[1];
    waiting_[1].clear();
    for (uint32_t i = 0; i < list.size(); ++i) {
      TraceLane& lane = lanes_[list[i]];
      const LeafView leaf = lane.leaf();
      touch_ray(meter_, lane, *lane.space, *lane.job->ray, lane.job->triangle_tests, false);
      touch_candidates(meter_, leaf);
      lane.job->triangle_tests += leaf.triangle_count;
      lane.candidates = find_candidates<kTest>(*lane.space, leaf, lane.job->ray->t);
    }
    for (uint32_t i = 0; i < list.size(); ++i) {
      TraceLane& lane = lanes_[list[i]];
      if (lane.candidates != 0) test_candidates(lane);
      go_on(list[i]);
    }
  }

  HWY_INLINE void test_candidates(TraceLane& lane) {
    const TreeletView treelet(lane.job->page);
    const LeafView leaf = lane.leaf();
    for (uint32_t mask = lane.candidates; mask != 0; mask &= mask - 1) {
      const uint32_t i = static_cast<uint32_t>(std::countr_zero(mask));
      TriangleHit hit;
      Ray& ray = *lane.job->ray;
      if (intersect_stored_by<kTest>(*lane.space, leaf, i, ray.t, hit) &&
          take_hit(treelet, leaf, leaf_offset(lane.ref), i, hit, ray, lane.job->entry.treelet, counters_)) {
        lane.size = 0;  // an any-hit ray is done
        return;
      }
    }
  }

  static constexpr uint32_t kNodes = 0, kLeaves = 1;  // of waiting_, by kLeafBit

  std::span<TraceJob> jobs_;
  TraceCounters& counters_;
  [[no_unique_address]] Meter meter_;
  size_t next_job_ = 0;
  LaneList waiting_[2];  ///< lanes that stand before a node, before a leaf
  TraceLane lanes_[kTraceLanes];
};

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#endif
