// Rays of a stream through a scene in memory, single, several in turn, by one kind of triangle test: the loop behind
// LaneTracer. Included once a target by trace_scene_lanes.cpp and trace_other_kinds.cpp (foreach_target.h).
#if defined(SHOAL_TREELETS_STREAM_TRACER_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SHOAL_TREELETS_STREAM_TRACER_INL_H
#undef SHOAL_TREELETS_STREAM_TRACER_INL_H
#else
#define SHOAL_TREELETS_STREAM_TRACER_INL_H
#endif

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include "treelets/hit_kernel-inl.h"
#include "treelets/leaf_kernel-inl.h"
#include "treelets/node_kernel-inl.h"
#include "treelets/scene_kernels.h"
#include "treelets/space_kernel-inl.h"
#include "treelets/touch_kernel-inl.h"

#ifndef SHOAL_TREELETS_SCENE_LANE
#define SHOAL_TREELETS_SCENE_LANE
namespace shoal {

/// Rays traced in turn: while one waits for memory or a result the others go on. Fewer are slower, 24 no faster.
inline constexpr uint32_t kSceneLanes = 16;

enum class LanePlace : uint32_t { kWorld, kObject, kTreelet };

/// A ray on its way: what is still to visit, the nearest on top.
struct SceneLane {
  Ray* ray;
  const RaySpace* space;
  const QuantizedNode* nodes;  ///< of the treelet it is in, as the next three
  const std::byte* leaves;
  const std::byte* page;
  TreeletEntry entry;
  uint32_t ref;            ///< to visit now
  uint32_t size;           ///< of the stack
  uint32_t base;           ///< what lies below belongs to the tree above
  uint32_t instance_base;  ///< the same for the object's tree
  LanePlace place;
  uint32_t candidates;  ///< of the leaf `ref`
  RayWork work;
  RayContext context;
  uint32_t keys[kSceneStack];
  uint32_t refs[kSceneStack];

  LeafView leaf() const { return LeafView(leaves + size_t{4} * leaf_offset(ref)); }
};

struct SceneLanes {
  SceneLane lanes[kSceneLanes];
};

}  // namespace shoal
#endif

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

class SceneLaneList {
 public:
  uint32_t size() const { return size_; }
  uint32_t operator[](uint32_t i) const { return lanes_[i]; }
  void clear() { size_ = 0; }
  void add(uint32_t lane) { lanes_[size_++] = static_cast<uint8_t>(lane); }

 private:
  uint32_t size_ = 0;
  uint8_t lanes_[kSceneLanes];
};

#if HWY_MAX_BYTES >= 32
/// As enter_children(), of a node of the top tree; references as top_ref() makes them.
HWY_INLINE uint32_t enter_top_children(const RaySpace& ray, const TopNode& node, float t, uint32_t* keys,
                                       uint32_t* refs) {
  const U8 u;
  const auto plane = [&](uint32_t side, uint32_t axis)
                         HWY_ATTR { return hn::Load(F8(), (side != 0 ? node.hi : node.lo)[axis]); };
  const BoxLanes boxes = cross_boxes(ray, t, ray.slope, ray.near_bias, ray.far_bias, 0, plane);
  const auto key = hn::IfThenElseZero(hn::RebindMask(u, boxes.entered), hn::Or(boxes.key, hn::Set(u, kEnteredBit)));
  const auto kinds = hn::PromoteTo(u, hn::LoadU(B8(), reinterpret_cast<const uint8_t*>(node.kind)));
  const auto child = hn::Or(hn::Load(u, node.child), hn::ShiftLeft<kKindShift>(kinds));
  const auto sorted = sort_lanes(key);
  const auto slots = hn::IndicesFromVec(u, hn::And(sorted, hn::Set(u, 7)));
  hn::StoreU(sorted, u, keys);
  hn::StoreU(hn::TableLookupLanes(child, slots), u, refs);
  return static_cast<uint32_t>(hn::CountTrue(u, hn::Ne(sorted, hn::Zero(u))));
}
#else
HWY_INLINE uint32_t enter_top_children(const RaySpace& ray, const TopNode& node, float t, uint32_t* keys,
                                       uint32_t* refs) {
  const U8 u;
  HWY_ALIGN uint32_t all[8];
  for (size_t first = 0; first < 8; first += hn::Lanes(u)) {
    const auto plane = [&](uint32_t side, uint32_t axis)
                           HWY_ATTR { return hn::Load(F8(), (side != 0 ? node.hi : node.lo)[axis] + first); };
    const BoxLanes boxes = cross_boxes(ray, t, ray.slope, ray.near_bias, ray.far_bias, first, plane);
    hn::Store(hn::IfThenElseZero(hn::RebindMask(u, boxes.entered), hn::Or(boxes.key, hn::Set(u, kEnteredBit))), u,
              all + first);
  }
  uint32_t count = 0;
  for (uint32_t slot = 0; slot < 8; ++slot) {
    if (all[slot] == 0) continue;
    uint32_t i = count++;
    for (; i > 0 && keys[i - 1] < all[slot]; --i) keys[i] = keys[i - 1], refs[i] = refs[i - 1];
    keys[i] = all[slot], refs[i] = top_ref(node, slot);
  }
  return count;
}
#endif

/// `Meter`: NoTouches, or TouchMeter to tell what is touched (treelets/touch_log.h).
template <TriangleTest kTest, class Meter = NoTouches>
class StreamTracer {
 public:
  StreamTracer(const SceneTables& tables, SceneLanes& lanes, uint64_t most, RayStream& stream,
               TraceCounters& counters, Meter meter = {})
      : tables_(tables), lanes_(lanes.lanes), most_(most), stream_(stream), counters_(counters), meter_(meter) {}

  /// Returns the number of rays.
  HWY_INLINE uint64_t run() {
    for (uint32_t lane = 0; lane < kSceneLanes; ++lane) start(lane);
    for (;;) {
      if (HWY_UNLIKELY(idle_.size() > 0 && served_)) start_idle();
      const uint32_t tops = waiting_[kTops].size(), nodes = waiting_[kNodes].size(), leaves = waiting_[kLeaves].size();
      if (tops >= nodes && tops >= leaves) {
        if (tops == 0) return started_;
        cross_tops();
      } else if (nodes >= leaves) {
        cross_nodes();
      } else {
        cross_leaves();
      }
    }
  }

 private:
  static constexpr uint32_t kNodes = 0, kLeaves = 1, kTops = 2;  // of waiting_; the first two by kLeafBit

  /// Puts the next ray into the lane, if there is one.
  HWY_INLINE void start(uint32_t index) {
    while (started_ < most_) {
      Ray* ray = stream_.next();
      served_ = ray != nullptr;
      if (!served_) return idle_.add(index);
      ++started_;
      SceneLane& lane = lanes_[index];
      touch_write(meter_, ray, sizeof(Ray), TouchKind::kInHand);
      touch_write(meter_, &lane, offsetof(SceneLane, keys), TouchKind::kInHand);
      lane.ray = ray;
      lane.size = lane.base = lane.instance_base = 0;
      lane.work = {};
      if (tables_.tree->single_identity()) {
        ray->instance = 0;
        prepare_identity(*ray, tables_.instances[0].max_abs_coordinate, lane.context.object);
        lane.space = &lane.context.object;
        lane.place = LanePlace::kObject;
        lane.ref = tables_.instances[0].root_node;
      } else {
        lane.context.reset();
        lane.space = &tables_.tree->world_space(*ray, lane.context);
        lane.place = LanePlace::kWorld;
        lane.ref = 0;
      }
      if (HWY_LIKELY(!lane.space->extreme)) return waiting_[kTops].add(index);
      stream_.done(*ray, trace_slowly(tables_, *ray, stream_, counters_));
    }
  }

  /// The stream, which had no ray for some lanes, has given one since.
  HWY_NOINLINE void start_idle() {
    const SceneLaneList list = idle_;
    idle_.clear();
    for (uint32_t i = 0; i < list.size(); ++i) start(list[i]);
  }

  /// The lane visits lane.ref, in its treelet, when its turn comes.
  HWY_INLINE void wait(uint32_t index) {
    const SceneLane& lane = lanes_[index];
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

  /// Goes on to the nearest of what is left, or to the next ray.
  HWY_INLINE void go_on(uint32_t index) {
    SceneLane& lane = lanes_[index];
    const float t = lane.ray->t;
    for (;;) {
      while (lane.size > lane.base) {
        --lane.size;
        touch_pop(meter_, lane);
        if (key_t(lane.keys[lane.size]) > t) continue;
        lane.ref = lane.refs[lane.size];
        if (HWY_LIKELY(lane.place == LanePlace::kTreelet)) return wait(index);
        if (!descend(lane)) continue;
        if (lane.place == LanePlace::kTreelet) return wait(index);
        if (HWY_LIKELY(!lane.space->extreme)) return waiting_[kTops].add(index);
        RayWork work = trace_slowly(tables_, *lane.ray, stream_, counters_);
        work.node_tests += lane.work.node_tests, work.triangle_tests += lane.work.triangle_tests;
        work.treelets += lane.work.treelets;
        stream_.done(*lane.ray, work);
        return start(index);
      }
      if (!ascend(lane)) return finish(index);
    }
  }

  HWY_INLINE void finish(uint32_t index) {
    SceneLane& lane = lanes_[index];
    lane.ray->instance = kNoIndex;
    stream_.done(*lane.ray, lane.work);
    start(index);
  }

  /// Into the child of a node of the top tree that lane.ref names; false: its page cannot be had.
  HWY_INLINE bool descend(SceneLane& lane) {
    const uint32_t child = lane.ref & kIndexMask;
    switch (kind_of(lane.ref)) {
      case ChildKind::kEntry:
        touch_read(meter_, &tables_.entries[child], sizeof(TreeletEntry), TouchKind::kTopTree);
        return enter_treelet(lane, tables_.entries[child]);
      case ChildKind::kNode: {
        lane.ref = child;
        const auto* at = reinterpret_cast<const std::byte*>(tables_.nodes + child);
        for (int line = 0; line < 4; ++line) hwy::Prefetch(at + 64 * line);
        touch_ahead(meter_, at, 4, TouchKind::kTopTree);
        return true;
      }
      case ChildKind::kInstance:
        lane.place = LanePlace::kObject;
        lane.base = lane.instance_base = lane.size;
        lane.ray->instance = child;
        touch_space(meter_, *lane.ray, tables_.instances[child], lane.context);
        lane.space = &lane.context.object_space(*lane.ray, tables_.instances[child]);
        lane.ref = tables_.instances[child].root_node;
        return true;
      case ChildKind::kEmpty:  // never entered in a well-formed tree
        break;
    }
    return false;
  }

  HWY_INLINE bool enter_treelet(SceneLane& lane, const TreeletEntry& entry) {
    const std::byte* page = page_of(tables_, entry.treelet, stream_);
    if (HWY_UNLIKELY(page == nullptr)) return false;
    const TreeletView treelet(page);
    touch_read(meter_, &tables_.pages[entry.treelet], sizeof page, TouchKind::kTopTree);
    touch_read(meter_, &treelet.header->leaves_offset, sizeof(uint32_t), TouchKind::kNodes);
    lane.place = LanePlace::kTreelet;
    lane.base = lane.size;
    lane.entry = entry;
    lane.page = page;
    lane.nodes = treelet.nodes;
    lane.leaves = page + treelet.header->leaves_offset;
    lane.ref = entry.root;
    ++lane.work.treelets;
    return true;
  }

  /// To the tree above; false at the end.
  HWY_INLINE bool ascend(SceneLane& lane) {
    if (lane.place == LanePlace::kTreelet) {
      lane.place = LanePlace::kObject;
      lane.base = lane.instance_base;
      return true;
    }
    if (lane.place == LanePlace::kWorld || tables_.tree->single_identity()) return false;
    lane.place = LanePlace::kWorld;
    lane.space = &lane.context.world;
    lane.base = lane.instance_base = 0;
    lane.ray->instance = kNoIndex;
    return true;
  }

  HWY_INLINE void cross_tops() {
    const SceneLaneList list = waiting_[kTops];
    waiting_[kTops].clear();
    for (uint32_t i = 0; i < list.size(); ++i) {
      SceneLane& lane = lanes_[list[i]];
      ++lane.work.node_tests;
      touch_ray(meter_, lane, *lane.space, *lane.ray, lane.work.node_tests, true);
      touch_top_node(meter_, tables_.nodes[lane.ref]);
      touch_entered(meter_, lane);
      lane.size += enter_top_children(*lane.space, tables_.nodes[lane.ref], lane.ray->t, lane.keys + lane.size,
                                      lane.refs + lane.size);
    }
    for (uint32_t i = 0; i < list.size(); ++i) go_on(list[i]);
  }

  HWY_INLINE void cross_nodes() {
    const SceneLaneList list = waiting_[kNodes];
    waiting_[kNodes].clear();
    for (uint32_t i = 0; i < list.size(); ++i) {
      SceneLane& lane = lanes_[list[i]];
      ++lane.work.node_tests;
      touch_ray(meter_, lane, *lane.space, *lane.ray, lane.work.node_tests, true);
      touch_node(meter_, lane.nodes[lane.ref]);
      touch_entered(meter_, lane);
      lane.size += enter_children(*lane.space, lane.nodes[lane.ref], lane.ray->t, lane.keys + lane.size,
                                  lane.refs + lane.size);
    }
    for (uint32_t i = 0; i < list.size(); ++i) go_on(list[i]);
  }

  HWY_INLINE void cross_leaves() {
    const SceneLaneList list = waiting_[kLeaves];
    waiting_[kLeaves].clear();
    for (uint32_t i = 0; i < list.size(); ++i) {
      SceneLane& lane = lanes_[list[i]];
      const LeafView leaf = lane.leaf();
      touch_ray(meter_, lane, *lane.space, *lane.ray, lane.work.triangle_tests, false);
      touch_candidates(meter_, leaf);
      lane.work.triangle_tests += leaf.triangle_count;
      lane.candidates = find_candidates<kTest>(*lane.space, leaf, lane.ray->t);
    }
    for (uint32_t i = 0; i < list.size(); ++i) {
      SceneLane& lane = lanes_[list[i]];
      if (lane.candidates != 0 && test_candidates(lane)) {
        finish(list[i]);
      } else {
        go_on(list[i]);
      }
    }
  }

  /// True when an any-hit ray is done.
  HWY_INLINE bool test_candidates(SceneLane& lane) {
    const TreeletView treelet(lane.page);
    const LeafView leaf = lane.leaf();
    for (uint32_t mask = lane.candidates; mask != 0; mask &= mask - 1) {
      const uint32_t i = static_cast<uint32_t>(std::countr_zero(mask));
      TriangleHit hit;
      if (intersect_stored_by<kTest>(*lane.space, leaf, i, lane.ray->t, hit) &&
          take_hit(treelet, leaf, leaf_offset(lane.ref), i, hit, *lane.ray, lane.entry.treelet, counters_)) {
        return true;
      }
    }
    return false;
  }

  const SceneTables& tables_;
  SceneLane* lanes_;
  const uint64_t most_;
  uint64_t started_ = 0;
  RayStream& stream_;
  TraceCounters& counters_;
  [[no_unique_address]] Meter meter_;
  SceneLaneList waiting_[3];
  SceneLaneList idle_;   ///< lanes that the stream had no ray for
  bool served_ = false;  ///< it had one when it was last asked
};

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#endif
