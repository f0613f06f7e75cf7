// clang-format off: the order of these lines matters
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "bench/touched_kernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>
// clang-format on

#include "bench/touched_kernels.h"
#include "treelets/leaf_kernel-inl.h"
#include "treelets/leaf_test.h"
#include "treelets/node_kernel-inl.h"
#include "treelets/space_kernel-inl.h"
#include "treelets/trace_treelet_scalar.h"

#ifndef SHOAL_BENCH_TOUCHED_LANES
#define SHOAL_BENCH_TOUCHED_LANES
namespace shoal::bench {

inline constexpr uint32_t kTouchedLanes = 16;  // kTraceLanes and kWalkLanes of the kernels
inline constexpr uint32_t kTouchedStack = 7 * kMaxTreeletDepth + 8;

struct TouchedTraceLane {
  TraceJob* job;
  const RaySpace* space;
  const std::byte* leaves;
  const QuantizedNode* nodes;
  NodeRef ref;
  uint32_t size;
  uint32_t candidates;
  uint32_t keys[kTouchedStack];
  NodeRef refs[kTouchedStack];

  LeafView leaf() const { return LeafView(leaves + size_t{4} * leaf_offset(ref)); }
};

struct TouchedWalkLane {
  NextJob* job;
  uint32_t node, slot;
  bool again;  ///< on the way up: go on behind `slot`
  uint32_t chosen_key;
  bool more;
  uint32_t bit;
};

struct TouchedLaneList {
  uint32_t size = 0;
  uint8_t lanes[kTouchedLanes];
  void add(uint32_t lane) { lanes[size++] = static_cast<uint8_t>(lane); }
};

}  // namespace shoal::bench
#endif

HWY_BEFORE_NAMESPACE();
namespace shoal::HWY_NAMESPACE {

using bench::DataKind;
using bench::TouchMeter;

HWY_INLINE void prepare_touching(const Ray& ray, const Instance& instance, RayContext& context, TouchMeter& meter) {
  if (context.object_instance == ray.instance) return meter.read(context.object, DataKind::kInHand);
  meter.read(&instance.identity, 16, DataKind::kTopTree);
  prepare_identity(ray, instance.max_abs_coordinate, context.object);
  context.object_instance = ray.instance;
  meter.write(context.object, DataKind::kInHand);
}

/// As Walker of treelets/top_tree.cpp, in a tree of one instance.
class TouchingWalker {
 public:
  TouchingWalker(const TopTree& tree, std::span<NextJob> jobs, TouchMeter& meter)
      : tree_(tree), nodes_(tree.nodes().data()), jobs_(jobs), meter_(meter) {}

  HWY_INLINE void run() {
    for (uint32_t lane = 0; lane < bench::kTouchedLanes && next_job_ < jobs_.size(); ++lane) {
      if (start(lanes_[active_])) ++active_;
    }
    while (active_ > 0) {
      for (uint32_t i = 0; i < active_; ++i) test(lanes_[i]);
      for (uint32_t i = 0; i < active_;) {
        if (go_on(lanes_[i]) || start(lanes_[i])) {
          ++i;
        } else if (--active_ != i) {
          lanes_[i] = lanes_[active_];
        }
      }
    }
  }

 private:
  using Lane = bench::TouchedWalkLane;

  HWY_INLINE bool start(Lane& lane) {
    while (next_job_ < jobs_.size()) {
      lane.job = &jobs_[next_job_++];
      Ray& ray = *lane.job->ray;
      const Instance& instance = tree_.instance(0);
      meter_.write(ray, DataKind::kInHand);
      lane.node = ray.cursor >> 3, lane.slot = ray.cursor & 7, lane.again = ray.cursor != kNoIndex;
      if (!lane.again) {
        ray.instance = 0;
        lane.node = instance.root_node;
        meter_.read(instance.root_node, DataKind::kTopTree);
      }
      prepare_touching(ray, instance, *lane.job->context, meter_);
      if (settle(lane)) return true;
    }
    return false;
  }

  HWY_INLINE bool settle(Lane& lane) {
    Ray& ray = *lane.job->ray;
    for (;;) {
      const TopNode& node = nodes_[lane.node];
      meter_.read(node.level, DataKind::kTopTree);
      lane.bit = node.level < tree_.more_levels() ? 1u << node.level : 0;
      if (!lane.again || lane.bit == 0 || (ray.more & lane.bit) != 0) {
        ++lane.job->node_tests;
        return true;
      }
      if (!climb(lane)) return leave(lane);
    }
  }

  HWY_INLINE bool climb(Lane& lane) {
    const TopNode& node = nodes_[lane.node];
    meter_.read(node.parent, DataKind::kTopTree);
    if (node.parent == kNoIndex) return false;
    lane.node = node.parent >> 3, lane.slot = node.parent & 7, lane.again = true;
    return true;
  }

  HWY_INLINE bool leave(Lane& lane) {
    Ray& ray = *lane.job->ray;
    ray.cursor = kNoIndex, ray.instance = kNoIndex, ray.more = 0;
    lane.job->entry = kNoIndex;
    return false;
  }

  HWY_INLINE void test(Lane& lane) {
    const TopNode& node = nodes_[lane.node];
    meter_.read(node.lo, sizeof node.lo + sizeof node.hi, DataKind::kTopTree);
    HWY_ALIGN uint32_t keys[8];
    uint32_t mask = cross(lane.job->context->object, node, lane.job->ray->t, keys);
    const int32_t after = lane.again ? static_cast<int32_t>(keys[lane.slot]) : -1;
    uint32_t best = kNoIndex, count = 0;
    for (; mask != 0; mask &= mask - 1) {
      const uint32_t key = keys[std::countr_zero(mask)];
      if (static_cast<int32_t>(key) <= after) continue;
      best = std::min(best, key);
      ++count;
    }
    lane.chosen_key = best, lane.more = count > 1;
  }

  static HWY_INLINE uint32_t cross(const RaySpace& ray, const TopNode& node, float t, uint32_t keys[8]) {
    if (HWY_UNLIKELY(ray.extreme)) return cross_extreme(ray, node, t, keys);
    uint32_t mask = 0;
    for (size_t first = 0; first < 8; first += hn::Lanes(F8())) {
      const auto plane = [&](uint32_t side, uint32_t axis)
                             HWY_ATTR { return hn::Load(F8(), (side != 0 ? node.hi : node.lo)[axis] + first); };
      const BoxLanes boxes = cross_boxes(ray, t, ray.slope, ray.near_bias, ray.far_bias, first, plane);
      hn::StoreU(boxes.key, U8(), keys + first);
      uint8_t bits[8] = {};
      hn::StoreMaskBits(F8(), boxes.entered, bits);
      mask |= uint32_t{bits[0]} << first;
    }
    return mask;
  }

  static uint32_t cross_extreme(const RaySpace& ray, const TopNode& node, float t, uint32_t keys[8]) {
    uint32_t mask = 0;
    for (uint32_t slot = 0; slot < 8; ++slot) {
      const float lo[3] = {node.lo[0][slot], node.lo[1][slot], node.lo[2][slot]};
      const float hi[3] = {node.hi[0][slot], node.hi[1][slot], node.hi[2][slot]};
      const BoxSpan span = cross_box(ray, lo, hi);
      keys[slot] = entry_key(span.t_near, slot);
      if (span.entered(t)) mask |= 1u << slot;
    }
    return mask;
  }

  HWY_INLINE bool go_on(Lane& lane) {
    Ray& ray = *lane.job->ray;
    ray.more = lane.more ? ray.more | lane.bit : ray.more & ~lane.bit;
    if (lane.chosen_key == kNoIndex) return climb(lane) ? settle(lane) : leave(lane);
    const uint32_t slot = lane.chosen_key & 7;
    const TopNode& node = nodes_[lane.node];
    meter_.read(node.child, sizeof node.child, DataKind::kTopTree);
    lane.slot = slot, lane.again = false;
    if (node.kind[slot] == ChildKind::kEntry) {
      ray.cursor = lane.node << 3 | slot;
      lane.job->entry = node.child[slot];
      return false;
    }
    SHOAL_CHECK(node.kind[slot] == ChildKind::kNode);
    lane.node = node.child[slot];
    const auto* below = reinterpret_cast<const std::byte*>(nodes_ + lane.node);
    for (int line = 0; line < 4; ++line) meter_.prefetch(below + 64 * line, DataKind::kTopTree);
    return settle(lane);
  }

  const TopTree& tree_;
  const TopNode* nodes_;
  std::span<NextJob> jobs_;
  TouchMeter& meter_;
  size_t next_job_ = 0;
  uint32_t active_ = 0;
  Lane lanes_[bench::kTouchedLanes];
};

/// As Tracer of treelets/treelet_tracer-inl.h.
class TouchingTracer {
 public:
  TouchingTracer(std::span<TraceJob> jobs, TraceCounters& counters, TouchMeter& meter)
      : jobs_(jobs), counters_(counters), meter_(meter) {}

  HWY_INLINE void run() {
    for (uint32_t lane = 0; lane < bench::kTouchedLanes; ++lane) start(lane);
    while (waiting_[0].size + waiting_[1].size > 0) {
      if (waiting_[0].size >= waiting_[1].size) {
        cross_nodes();
      } else {
        cross_leaves();
      }
    }
  }

 private:
  using Lane = bench::TouchedTraceLane;

  HWY_INLINE void start(uint32_t index) {
    while (next_job_ < jobs_.size()) {
      TraceJob& job = jobs_[next_job_++];
      meter_.write(*job.ray, DataKind::kInHand);
      prepare_touching(*job.ray, *job.instance, *job.context, meter_);
      if (HWY_UNLIKELY(job.context->object.extreme)) {
        trace_treelet_scalar(job, counters_);
        continue;
      }
      Lane& lane = lanes_[index];
      const TreeletView treelet(job.page);
      meter_.read(treelet.header->leaves_offset, DataKind::kNodes);
      lane.job = &job;
      lane.space = &job.context->object;
      lane.nodes = treelet.nodes;
      lane.leaves = job.page + treelet.header->leaves_offset;
      lane.ref = job.entry.root;
      lane.size = 0;
      return wait(index);
    }
  }

  HWY_INLINE void wait(uint32_t index) {
    const Lane& lane = lanes_[index];
    const bool leaf = is_leaf(lane.ref);
    const std::byte* at =
        leaf ? lane.leaf().leaf : reinterpret_cast<const std::byte*>(lane.nodes + lane.ref);
    for (int line = 0; line < 3; ++line) {
      meter_.prefetch(at + 64 * line, leaf ? DataKind::kLeaves : DataKind::kNodes);
    }
    waiting_[leaf ? 1 : 0].add(index);
  }

  HWY_INLINE void go_on(uint32_t index) {
    Lane& lane = lanes_[index];
    const float t = lane.job->ray->t;
    while (lane.size > 0) {
      --lane.size;
      meter_.read(lane.keys[lane.size], DataKind::kInHand);
      if (key_t(lane.keys[lane.size]) > t) continue;
      lane.ref = lane.refs[lane.size];
      meter_.read(lane.refs[lane.size], DataKind::kInHand);
      return wait(index);
    }
    start(index);
  }

  HWY_INLINE void cross_nodes() {
    const bench::TouchedLaneList list = waiting_[0];
    waiting_[0].size = 0;
    for (uint32_t i = 0; i < list.size; ++i) {
      Lane& lane = lanes_[list.lanes[i]];
      ++lane.job->node_tests;
      meter_.read(lane.nodes[lane.ref], DataKind::kNodes);
      meter_.write(lane.keys + lane.size, 32, DataKind::kInHand);
      meter_.write(lane.refs + lane.size, 32, DataKind::kInHand);
      lane.size += enter_children(*lane.space, lane.nodes[lane.ref], lane.job->ray->t, lane.keys + lane.size,
                                  lane.refs + lane.size);
    }
    for (uint32_t i = 0; i < list.size; ++i) go_on(list.lanes[i]);
  }

  HWY_INLINE void cross_leaves() {
    const bench::TouchedLaneList list = waiting_[1];
    waiting_[1].size = 0;
    for (uint32_t i = 0; i < list.size; ++i) {
      Lane& lane = lanes_[list.lanes[i]];
      const LeafView leaf = lane.leaf();
      touch_leaf(leaf);
      lane.job->triangle_tests += leaf.triangle_count;
      lane.candidates = find_candidates(*lane.space, leaf, lane.job->ray->t);
    }
    for (uint32_t i = 0; i < list.size; ++i) {
      if (lanes_[list.lanes[i]].candidates != 0) test_candidates(lanes_[list.lanes[i]]);
      go_on(list.lanes[i]);
    }
  }

  /// What find_candidates() reads.
  HWY_INLINE void touch_leaf(const LeafView& leaf) {
    const bool floats = leaf.has_floats(), grid = leaf.has_grid();
    meter_.read(leaf.leaf, floats ? sizeof(LeafHeader) : LeafParts::kLow, DataKind::kLeaves);
    for (size_t first = 0; first < leaf.vertex_count; first += kLeafLanes) {
      for (uint32_t axis = 0; axis < 3; ++axis) {
        if (floats) {
          meter_.read(leaf.floats(axis) + first, 4 * kLeafLanes, DataKind::kLeaves);
        } else {
          if (grid) meter_.read(leaf.grid_low(axis) + first, kLeafLanes, DataKind::kLeaves);
          if (!grid) meter_.read(leaf.low(axis) + first, 2 * kLeafLanes, DataKind::kLeaves);
          meter_.read((grid ? leaf.grid_high(axis) : leaf.high(axis)) + first, kLeafLanes, DataKind::kLeaves);
        }
      }
    }
    for (size_t first = 0; first < leaf.triangle_count; first += kLeafLanes) {
      for (uint32_t k = 0; k < 3; ++k) meter_.read(leaf.corner(k) + first, kLeafLanes, DataKind::kLeaves);
    }
  }

  HWY_INLINE void test_candidates(Lane& lane) {
    const TreeletView treelet(lane.job->page);
    const LeafView leaf = lane.leaf();
    for (uint32_t mask = lane.candidates; mask != 0; mask &= mask - 1) {
      const uint32_t i = static_cast<uint32_t>(std::countr_zero(mask));
      const Hit before = lane.job->ray->hit;
      const bool done = test_triangle<TriangleTest::kWatertight>(treelet, leaf, leaf_offset(lane.ref), i, *lane.space,
                                                                *lane.job, counters_);
      const Hit& after = lane.job->ray->hit;
      if (after.instance != before.instance || after.primitive != before.primitive) {
        for (uint32_t byte = 0; byte < leaf.header().primitive_bytes; ++byte) {
          meter_.read(leaf.corner(3) + i + size_t{byte} * leaf.triangle_count, 1, DataKind::kLeaves);
        }
      }
      if (done) {
        lane.size = 0;
        return;
      }
    }
  }

  std::span<TraceJob> jobs_;
  TraceCounters& counters_;
  TouchMeter& meter_;
  size_t next_job_ = 0;
  bench::TouchedLaneList waiting_[2];  ///< lanes that stand before a node, before a leaf
  Lane lanes_[bench::kTouchedLanes];
};

void walk_touching(const TopTree& tree, std::span<NextJob> jobs, TouchMeter& meter) {
  TouchingWalker(tree, jobs, meter).run();
}
void trace_touching(std::span<TraceJob> jobs, TraceCounters& counters, TouchMeter& meter) {
  TouchingTracer(jobs, counters, meter).run();
}

}  // namespace shoal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace shoal {

HWY_EXPORT(walk_touching);
HWY_EXPORT(trace_touching);

namespace bench {

void next_entries_touching(const TopTree& tree, std::span<NextJob> jobs, TouchMeter& meter) {
  HWY_DYNAMIC_DISPATCH(walk_touching)(tree, jobs, meter);
}

void trace_treelets_touching(std::span<TraceJob> jobs, TraceCounters& counters, TouchMeter& meter) {
  HWY_DYNAMIC_DISPATCH(trace_touching)(jobs, counters, meter);
}

}  // namespace bench
}  // namespace shoal
#endif
