// A packet's way through a scene in memory: one stack for all its rays, through the tree over instances, an
// object's tree and its treelets. What packets do with rays that do not take part is the Policy's; this is what
// they share. Included once a target by trace_packets.cpp and trace_packets_reorder.cpp (foreach_target.h).
//
// A box is tested when its turn comes, row by row; those of children are bounded first by interval arithmetic, and
// wait in the order in which the first ray that is known to be in the node meets them.
//
// Policy::kFirstRowSuffices: an inner node is entered as soon as a row has a ray that enters it; rows after it are
//   taken along untested (Wald, Boulos & Shirley 2007, 4.1). Else it is known of every ray.
// Policy::reorders(rays, rows): whether so many rays in so many rows are put together anew.
#if defined(SHOAL_TREELETS_PACKET_WALK_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SHOAL_TREELETS_PACKET_WALK_INL_H
#undef SHOAL_TREELETS_PACKET_WALK_INL_H
#else
#define SHOAL_TREELETS_PACKET_WALK_INL_H
#endif

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include "treelets/hit_kernel-inl.h"
#include "treelets/leaf_kernel-inl.h"
#include "treelets/packet_frames-inl.h"
#include "treelets/space_kernel-inl.h"
#include "treelets/touch_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

/// `Meter`: NoTouches, or TouchMeter to tell what is touched (treelets/touch_log.h).
template <TriangleTest kTest, class Policy, class Meter = NoTouches>
class PacketWalk : private PacketFrames {
 public:
  PacketWalk(const SceneTables& tables, PacketWalkState& state, RayStream& stream, TraceCounters& counters,
             Meter meter = {})
      : PacketFrames(state), tables_(tables), stream_(stream), counters_(counters), meter_(meter) {}

  /// Packets of `size` rays until the stream has no more and none wait.
  HWY_INLINE void run(uint32_t size) {
    s_.waiting_count[0] = s_.waiting_count[1] = 0;
    while (const uint32_t count = take(size)) {
      walk(count);
      for (uint32_t i = 0; i < count; ++i) {
        touch_ray_and_work(i);
        s_.rays[i]->instance = kNoIndex;
        s_.work[i].node_tests += (s_.box_tests[i] + 7) / 8;
        stream_.done(*s_.rays[i], s_.work[i]);
      }
    }
  }

 private:
  /// A full packet of rays that ask the same, or what there is when the stream has no more.
  HWY_INLINE uint32_t take(uint32_t size) {
    uint32_t kind = 0;
    for (;;) {
      Ray* ray = stream_.next();
      if (ray == nullptr) break;
      kind = ray->any_hit() ? 1 : 0;
      s_.waiting[kind][s_.waiting_count[kind]++] = ray;
      if (s_.waiting_count[kind] == size) break;
    }
    if (s_.waiting_count[kind] != size) kind = s_.waiting_count[0] >= s_.waiting_count[1] ? 0 : 1;
    const uint32_t count = s_.waiting_count[kind];
    std::copy_n(s_.waiting[kind], count, s_.rays);
    touch_write(meter_, s_.waiting[kind], count * sizeof(Ray*), TouchKind::kInHand);
    touch_write(meter_, s_.rays, count * sizeof(Ray*), TouchKind::kInHand);
    s_.waiting_count[kind] = 0;
    return count;
  }

  HWY_INLINE void walk(uint32_t count) {
    s_.row_count = s_.frame_count = s_.scope_count = s_.size = 0;
    const bool identity = tables_.tree->single_identity();
    Frame& frame = open_frame();
    for (uint32_t i = 0; i < count; ++i) {
      Ray& ray = *s_.rays[i];
      touch_ray_and_work(i);
      s_.work[i] = {}, s_.box_tests[i] = 0, s_.gone[i] = false;
      RayContext context;
      if (identity) {
        ray.instance = 0;
        touch_write(meter_, &s_.space[i], sizeof(RaySpace), TouchKind::kInHand);
        prepare_identity(ray, tables_.instances[0].max_abs_coordinate, s_.space[i]);
      }
      const RaySpace& space = identity ? s_.space[i] : tables_.tree->world_space(ray, context);
      add_ray(frame, i, space, 0);
    }
    if (!close_frame(frame)) return;
    s_.scopes[s_.scope_count++] = {&frame, 0, false, {}, nullptr, nullptr, nullptr};
    mask_all(frame);
    cross_top(identity ? tables_.instances[0].root_node : 0, frame.live);
    while (s_.scope_count > 0) {
      if (s_.size == scope().base) {
        leave();
      } else {
        step(s_.stack[--s_.size]);
      }
    }
  }

  /// Of a packet that begins or ends.
  HWY_INLINE void touch_ray_and_work(uint32_t ray) {
    touch_write(meter_, s_.rays[ray], sizeof(Ray), TouchKind::kInHand);
    touch_write(meter_, &s_.work[ray], sizeof(RayWork), TouchKind::kInHand);
    touch_write(meter_, &s_.box_tests[ray], sizeof s_.box_tests[ray], TouchKind::kInHand);
    touch_write(meter_, &s_.gone[ray], sizeof s_.gone[ray], TouchKind::kInHand);
  }

  HWY_INLINE PacketScope& scope() { return s_.scopes[s_.scope_count - 1]; }
  /// One that the kernels cannot take goes to its end at once.
  HWY_INLINE void add_ray(Frame& frame, uint32_t ray, const RaySpace& space, uint32_t outer) {
    if (HWY_UNLIKELY(space.extreme)) return trace_alone(ray);
    const uint32_t lane = add_lane(frame, ray, outer);
    Row& at = row(frame, frame.row_count - 1);
    touch_write(meter_, &at, sizeof(Row), TouchKind::kInHand);  // a lane has a word of each of its lines
    for (uint32_t axis = 0; axis < 3; ++axis) {
      at.slope[axis][lane] = space.slope[axis];
      at.near_bias[axis][lane] = space.near_bias[axis], at.far_bias[axis][lane] = space.far_bias[axis];
    }
  }

  HWY_NOINLINE void trace_alone(uint32_t ray) {
    const RayWork work = trace_slowly(tables_, *s_.rays[ray], stream_, counters_);
    s_.gone[ray] = true;
    s_.work[ray].node_tests += work.node_tests, s_.work[ray].triangle_tests += work.triangle_tests;
    s_.work[ray].treelets += work.treelets;
  }

  /// The rays of the masks go on in rows of their own until the stack is back at its present height.
  HWY_NOINLINE void reorder(uint32_t rows) {
    const PacketScope& around = scope();
    Frame& frame = open_frame();
    each_masked(*around.frame, rows, [&](uint32_t r, Row& from, uint32_t lane, uint32_t ray) HWY_ATTR {
      const uint32_t to = add_lane(frame, ray, r << 4 | lane);
      touch_read(meter_, &from, sizeof(Row), TouchKind::kInHand);
      touch_ray(ray);
      touch_write(meter_, &row(frame, frame.row_count - 1), sizeof(Row), TouchKind::kInHand);
      copy_lane(from, lane, row(frame, frame.row_count - 1), to);
    });
    close_frame(frame);
    PacketScope inner = around;
    inner.frame = &frame, inner.base = s_.size;
    s_.scopes[s_.scope_count++] = inner;
    mask_all(frame);
  }

  /// To the scope around, with what its rays have found meanwhile.
  HWY_INLINE void leave() {
    const Frame& inner = *scope().frame;
    --s_.scope_count;
    if (s_.scope_count > 0 && scope().frame == &inner) return;
    for (uint32_t i = 0; i < inner.ray_count; ++i) {
      const Row& from = row(inner, i / kRowRays);
      const uint32_t lane = i % kRowRays, ray = from.ray[lane];
      touch_read(meter_, from.ray, sizeof(Row) - offsetof(Row, ray), TouchKind::kInHand);
      touch_write(meter_, &s_.box_tests[ray], sizeof s_.box_tests[ray], TouchKind::kInHand);
      if (s_.scope_count > 0) touch_updated(row(*scope().frame, from.outer[lane] >> 4), ray);
      s_.box_tests[ray] += from.box_tests;
      if (s_.scope_count > 0) update(*scope().frame, from.outer[lane], ray);
    }
    s_.row_count = inner.first_row;
    --s_.frame_count;
  }

  HWY_INLINE bool is_inner(uint32_t ref) {
    return scope().in_treelet ? !is_leaf(ref) : kind_of(ref) == ChildKind::kNode;
  }

  HWY_INLINE void step(const WaitingBox& waiting) {
    const WaitingBox box = waiting;  // what is pushed overwrites it
    touch_read(meter_, &waiting, sizeof waiting, TouchKind::kInHand);
    const Frame& frame = *scope().frame;
    const bool inner = is_inner(box.ref);
    uint32_t rows = find_rows(frame, box, Policy::kFirstRowSuffices && inner);
    if (rows == 0) return;
    if (inner && !Policy::kFirstRowSuffices && (rows & (rows - 1)) != 0 &&
        Policy::reorders(ray_count(rows), std::popcount(rows))) {
      reorder(rows);
      rows = scope().frame->live;
    }
    visit(box.ref, rows);
    prefetch_next();
  }

  /// Rows of which rays enter the box, and sets their masks. `first_only`: once there is one, it and all after it.
  HWY_INLINE uint32_t find_rows(const Frame& frame, const WaitingBox& box, bool first_only) {
    uint32_t found = 0;
    for (uint32_t left = box.rows & frame.live; left != 0; left &= left - 1) {
      const auto r = static_cast<uint32_t>(std::countr_zero(left));
      Row& at = row(frame, r);
      masks_[r] = enter_box(at, box) & at.alive;
      touch_read(meter_, &at, offsetof(Row, ray), TouchKind::kInHand);
      touch_write(meter_, &at.alive, sizeof at.alive + sizeof at.box_tests, TouchKind::kInHand);
      ++at.box_tests;
      counters_.simd_lanes_count += kRowRays;
      if (masks_[r] == 0) continue;
      counters_.simd_active_lanes_count += static_cast<uint32_t>(std::popcount(masks_[r]));
      touch_lanes(static_cast<uint32_t>(std::popcount(masks_[r])));
      if (first_only) return left;
      found |= 1u << r;
    }
    return found;
  }

  /// Children that rays may enter go to the stack, the first to be met on top. Requires: the mask of the first of
  /// `rows`.
  HWY_INLINE void push_children(const ChildBoxes& boxes, uint32_t rows) {
    const Frame& frame = *scope().frame;
    touch_read(meter_, &frame, sizeof frame, TouchKind::kInHand);
    const auto first = static_cast<uint32_t>(std::countr_zero(rows));
    float near[8];
    near_of(row(frame, first), static_cast<uint32_t>(std::countr_zero(masks_[first])), boxes, near);
    uint32_t keys[8], size = 0;
    for (uint32_t left = may_enter(frame, boxes) & boxes.there; left != 0; left &= left - 1) {
      const auto slot = static_cast<uint32_t>(std::countr_zero(left));
      const uint32_t key = entry_key(near[slot], slot);
      uint32_t i = size++;
      for (; i > 0 && keys[i - 1] < key; --i) keys[i] = keys[i - 1];
      keys[i] = key;
    }
    for (uint32_t i = 0; i < size; ++i) {
      const uint32_t slot = keys[i] & 7;
      WaitingBox& box = s_.stack[s_.size++];
      touch_write(meter_, &box, sizeof box, TouchKind::kInHand);
      for (uint32_t axis = 0; axis < 3; ++axis)
        box.lo[axis] = boxes.lo[axis][slot], box.hi[axis] = boxes.hi[axis][slot];
      box.ref = boxes.refs[slot];
      box.rows = rows;
    }
  }

  HWY_INLINE void cross_top(uint32_t index, uint32_t rows) {
    touch_read(meter_, &tables_.nodes[index], sizeof(TopNode), TouchKind::kTopTree);
    push_children(ChildBoxes(tables_.nodes[index]), rows);
  }
  HWY_INLINE void cross_node(NodeRef ref, uint32_t rows) {
    touch_read(meter_, &scope().nodes[ref], sizeof(QuantizedNode), TouchKind::kNodes);
    push_children(ChildBoxes(scope().nodes[ref]), rows);
  }

  /// What is on top of the stack comes next.
  HWY_INLINE void prefetch_next() {
    if (s_.scope_count == 0 || s_.size == scope().base) return;
    const uint32_t ref = s_.stack[s_.size - 1].ref;
    const std::byte* at = nullptr;
    if (!scope().in_treelet) {
      if (kind_of(ref) != ChildKind::kNode) return;
      at = reinterpret_cast<const std::byte*>(tables_.nodes + (ref & kIndexMask));
    } else {
      at = is_leaf(ref) ? scope().leaves + size_t{4} * leaf_offset(ref)
                        : reinterpret_cast<const std::byte*>(scope().nodes + ref);
    }
    touch_ahead(meter_, at, 3,
                !scope().in_treelet ? TouchKind::kTopTree
                : is_leaf(ref)      ? TouchKind::kLeaves
                                    : TouchKind::kNodes);
    for (int line = 0; line < 3; ++line) hwy::Prefetch(at + 64 * line);
  }

  HWY_INLINE void visit(uint32_t ref, uint32_t rows) {
    if (scope().in_treelet) return is_leaf(ref) ? cross_leaf(ref, rows) : cross_node(ref, rows);
    const uint32_t child = ref & kIndexMask;
    switch (kind_of(ref)) {
      case ChildKind::kNode:
        return cross_top(child, rows);
      case ChildKind::kEntry:
        return enter_treelet(tables_.entries[child], rows);
      case ChildKind::kInstance:
        return enter_instance(child, rows);
      case ChildKind::kEmpty:
        return;
    }
  }

  HWY_NOINLINE void enter_treelet(const TreeletEntry& entry, uint32_t rows) {
    const std::byte* page = page_of(tables_, entry.treelet, stream_);
    if (HWY_UNLIKELY(page == nullptr)) return;
    each_masked(*scope().frame, rows, [&](uint32_t, Row& at, uint32_t, uint32_t ray) HWY_ATTR {
      touch_read(meter_, at.ray, sizeof at.ray, TouchKind::kInHand);
      touch_write(meter_, &s_.work[ray], sizeof(RayWork), TouchKind::kInHand);
      ++s_.work[ray].treelets;
    });
    const TreeletView treelet(page);
    touch_read(meter_, &entry, sizeof entry, TouchKind::kTopTree);
    touch_read(meter_, &tables_.pages[entry.treelet], sizeof page, TouchKind::kTopTree);
    touch_read(meter_, &treelet.header->leaves_offset, sizeof(uint32_t), TouchKind::kNodes);
    PacketFrame* frame = scope().frame;
    s_.scopes[s_.scope_count++] = {frame,        s_.size, true, entry, page, page + treelet.header->leaves_offset,
                                   treelet.nodes};
    visit(entry.root, rows);
  }

  HWY_NOINLINE void enter_instance(uint32_t instance, uint32_t rows) {
    Frame& frame = open_frame();
    Frame& around = *scope().frame;
    touch_read(meter_, &tables_.instances[instance], sizeof(Instance), TouchKind::kTopTree);
    each_masked(around, rows, [&](uint32_t r, Row&, uint32_t lane, uint32_t ray) HWY_ATTR {
      touch_write(meter_, s_.rays[ray], sizeof(Ray), TouchKind::kInHand);
      touch_write(meter_, &s_.space[ray], sizeof(RaySpace), TouchKind::kInHand);
      s_.rays[ray]->instance = instance;
      s_.space[ray] = to_object_space(*s_.rays[ray], tables_.instances[instance]);
      add_ray(frame, ray, s_.space[ray], r << 4 | lane);
      if (HWY_UNLIKELY(s_.gone[ray])) remove(around, r, lane);
    });
    if (!close_frame(frame)) return;
    s_.scopes[s_.scope_count++] = {&frame, s_.size, false, {}, nullptr, nullptr, nullptr};
    mask_all(frame);
    cross_top(tables_.instances[instance].root_node, frame.live);
  }

  HWY_INLINE void cross_leaf(uint32_t ref, uint32_t rows) {
    const LeafView leaf(scope().leaves + size_t{4} * leaf_offset(ref));
    Frame& frame = *scope().frame;
    each_masked(frame, rows, [&](uint32_t r, Row& at, uint32_t lane, uint32_t ray) HWY_ATTR {
      touch_candidates(meter_, leaf);
      touch_tested(at, ray);
      s_.work[ray].triangle_tests += leaf.triangle_count;
      counters_.simd_lanes_count += kRowRays, counters_.simd_active_lanes_count += leaf.triangle_count;
      const uint32_t candidates = find_candidates<kTest>(s_.space[ray], leaf, s_.rays[ray]->t);
      if (candidates == 0) return;
      if (test_leaf(leaf, leaf_offset(ref), candidates, ray)) {
        touch_gone(at, ray);
        s_.gone[ray] = true;
        remove(frame, r, lane);
      }
      touch_write(meter_, at.t, sizeof at.t, TouchKind::kInHand);
      at.t[lane] = s_.rays[ray]->t;
    });
  }

  HWY_INLINE void touch_ray(uint32_t ray) {
    touch_read(meter_, &s_.rays[ray], sizeof(Ray*), TouchKind::kInHand);
    touch_read(meter_, &s_.rays[ray]->t, sizeof(float), TouchKind::kInHand);
  }
  /// A ray of the row is tested against a leaf.
  HWY_INLINE void touch_tested(const Row& at, uint32_t ray) {
    touch_read(meter_, at.ray, sizeof at.ray, TouchKind::kInHand);
    touch_read(meter_, &s_.space[ray], sizeof(RaySpace), TouchKind::kInHand);
    touch_write(meter_, &s_.work[ray], sizeof(RayWork), TouchKind::kInHand);
    touch_ray(ray);
  }
  HWY_INLINE void touch_gone(const Row& at, uint32_t ray) {
    touch_write(meter_, &s_.gone[ray], sizeof s_.gone[ray], TouchKind::kInHand);
    touch_write(meter_, &at.alive, sizeof at.alive, TouchKind::kInHand);
  }
  /// The row gets what the ray found in another frame.
  HWY_INLINE void touch_updated(const Row& at, uint32_t ray) {
    touch_ray(ray);
    touch_read(meter_, &s_.gone[ray], sizeof s_.gone[ray], TouchKind::kInHand);
    touch_write(meter_, at.t, sizeof at.t, TouchKind::kInHand);
    if (s_.gone[ray]) touch_gone(at, ray);
  }
  /// A row has rays that enter a box.
  HWY_INLINE void touch_lanes(uint32_t entered) {
    if constexpr (Meter::kMeters) meter_.log->lanes.packets.add(entered, kRowRays);
  }

  /// True when an any-hit ray is done.
  HWY_INLINE bool test_leaf(const LeafView& leaf, uint32_t offset, uint32_t candidates, uint32_t ray) {
    return test_candidates<kTest>(TreeletView(scope().page), leaf, offset, candidates, s_.space[ray], *s_.rays[ray],
                                  scope().entry.treelet, counters_);
  }

  const SceneTables& tables_;
  RayStream& stream_;
  TraceCounters& counters_;
  [[no_unique_address]] Meter meter_;
};

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#endif
