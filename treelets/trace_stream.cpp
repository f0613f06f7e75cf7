// clang-format off: the order of these lines matters
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "treelets/trace_stream.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>
// clang-format on

#include <hwy/cache_control.h>

#include "treelets/child_boxes-inl.h"
#include "treelets/hit_kernel-inl.h"
#include "treelets/leaf_kernel-inl.h"
#include "treelets/space_kernel-inl.h"
#include "treelets/stream_lists.h"
#include "treelets/touch_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

/// `Meter`: NoTouches, or TouchMeter to tell what is touched (treelets/touch_log.h).
template <TriangleTest kTest, class Meter = NoTouches>
class StreamWalk {
 public:
  StreamWalk(const SceneTables& tables, StreamState& state, RayStream& stream, TraceCounters& counters,
             Meter meter = {})
      : tables_(tables), s_(state), stream_(stream), counters_(counters), meter_(meter) {}

  HWY_INLINE void run() {
    while (const uint32_t count = take()) {
      walk(count);
      for (uint32_t i = 0; i < count; ++i) {
        touch_ray_and_work(i);
        s_.rays[i]->instance = kNoIndex;
        stream_.done(*s_.rays[i], s_.work[i]);
      }
    }
  }

 private:
  HWY_INLINE uint32_t take() {
    uint32_t count = 0;
    for (; count < kStreamRays; ++count) {
      Ray* ray = stream_.next();
      if (ray == nullptr) break;
      s_.rays[count] = ray;
      touch_write(meter_, &s_.rays[count], sizeof ray, TouchKind::kInHand);
    }
    return count;
  }

  HWY_INLINE void walk(uint32_t count) {
    const bool identity = tables_.tree->single_identity();
    s_.size = s_.scope_count = s_.used = s_.count = 0;
    for (uint32_t i = 0; i < count; ++i) {
      Ray& ray = *s_.rays[i];
      touch_ray_and_work(i);
      touch_write(meter_, &(identity ? s_.object : s_.world)[i], sizeof(RaySpace), TouchKind::kInHand);
      s_.work[i] = {}, s_.gone[i] = false;
      if (identity) {
        ray.instance = 0;
        prepare_identity(ray, tables_.instances[0].max_abs_coordinate, s_.object[i]);
      } else {
        RayContext context;
        s_.world[i] = tables_.tree->world_space(ray, context);
      }
      add_current(i, identity ? s_.object[i] : s_.world[i]);
    }
    s_.scopes[s_.scope_count++] = {0, false, identity ? s_.object : s_.world, {}, nullptr, nullptr, nullptr};
    cross_top(identity ? tables_.instances[0].root_node : 0);
    while (s_.scope_count > 0) {
      if (s_.size == scope().base) {
        --s_.scope_count;
      } else if (take_list()) {
        visit(s_.stack[s_.size].ref);
      }
    }
  }

  /// Of a stream that begins or ends.
  HWY_INLINE void touch_ray_and_work(uint32_t ray) {
    touch_write(meter_, s_.rays[ray], sizeof(Ray), TouchKind::kInHand);
    touch_write(meter_, &s_.work[ray], sizeof(RayWork), TouchKind::kInHand);
    touch_write(meter_, &s_.gone[ray], sizeof s_.gone[ray], TouchKind::kInHand);
  }

  HWY_INLINE StreamScope& scope() { return s_.scopes[s_.scope_count - 1]; }

  /// Puts the ray into the current list; one that the kernels cannot take goes to its end at once.
  HWY_INLINE void add_current(uint32_t ray, const RaySpace& space) {
    touch_write(meter_, &s_.current[s_.count], sizeof ray, TouchKind::kInHand);
    s_.current[s_.count] = ray;
    if (HWY_LIKELY(!space.extreme)) {
      ++s_.count;
      return;
    }
    const RayWork work = trace_slowly(tables_, *s_.rays[ray], stream_, counters_);
    s_.gone[ray] = true;
    s_.work[ray].node_tests += work.node_tests, s_.work[ray].triangle_tests += work.triangle_tests;
    s_.work[ray].treelets += work.treelets;
  }

  /// The list on top of the stack becomes the current one, without rays that end before they would get there.
  /// False: it was empty, or so long that its children might not have room, and is now two.
  HWY_INLINE bool take_list() {
    StreamList& list = s_.stack[s_.size - 1];
    touch_read(meter_, &list, sizeof list, TouchKind::kInHand);
    if (HWY_UNLIKELY(list.count > 1 && list.first + 8 * list.count > kStreamItems - kStreamReserve)) {
      const uint32_t half = list.count / 2;
      s_.stack[s_.size++] = {list.ref, list.first + list.count - half, half};
      list.count -= half;
      return false;
    }
    s_.count = 0;
    for (uint32_t i = 0; i < list.count; ++i) {
      const StreamItem& item = s_.items[list.first + i];
      touch_read(meter_, &item, sizeof item, TouchKind::kInHand);
      touch_read(meter_, &s_.gone[item.ray], sizeof(bool), TouchKind::kInHand);
      touch_read(meter_, &s_.rays[item.ray], sizeof(Ray*), TouchKind::kInHand);
      touch_read(meter_, &s_.rays[item.ray]->t, sizeof(float), TouchKind::kInHand);
      touch_write(meter_, &s_.current[s_.count], sizeof(uint32_t), TouchKind::kInHand);
      s_.current[s_.count] = item.ray;
      s_.count += !s_.gone[item.ray] && item.near <= s_.rays[item.ray]->t ? 1 : 0;
    }
    s_.used = list.first;
    --s_.size;
    return s_.count > 0;
  }

  /// Tests the rays of the current list against a node's children: a list for each that any enters, the one that
  /// they enter first on average on top.
  HWY_INLINE void cross(const ChildBoxes& boxes) {
    const F8 f;
    const U8 u;
    uint32_t counts[8] = {};
    float sums[8] = {};
    uint64_t entered_count = 0;
    const RaySpace* spaces = scope().spaces;
    for (uint32_t i = 0; i < s_.count; ++i) {
      const uint32_t ray = s_.current[i];
      touch_current(i);
      const RaySpace& space = spaces[ray];
      touch_tested(ray, space.slope, 64);  // slope, both biases, negative
      HWY_ALIGN uint32_t keys[8];
      uint32_t entered = 0;
      for (size_t first = 0; first < 8; first += hn::Lanes(f)) {
        const auto plane = [&](uint32_t side, uint32_t axis)
                               HWY_ATTR { return hn::Load(f, (side != 0 ? boxes.hi : boxes.lo)[axis] + first); };
        const BoxLanes lanes =
            cross_boxes(space, s_.rays[ray]->t, space.slope, space.near_bias, space.far_bias, first, plane);
        hn::Store(lanes.key, u, keys + first);
        uint8_t bits[8] = {};
        hn::StoreMaskBits(f, lanes.entered, bits);
        entered |= uint32_t{bits[0]} << first;
      }
      ++s_.work[ray].node_tests;
      entered &= boxes.there;
      entered_count += static_cast<uint32_t>(std::popcount(entered));
      for (; entered != 0; entered &= entered - 1) {
        const auto slot = static_cast<uint32_t>(std::countr_zero(entered));
        const float near = key_t(keys[slot]);
        touch_write(meter_, &s_.children[slot][counts[slot]], sizeof(StreamItem), TouchKind::kInHand);
        s_.children[slot][counts[slot]++] = {near, ray};
        sums[slot] += near;
      }
    }
    counters_.simd_lanes_count += uint64_t{8} * s_.count, counters_.simd_active_lanes_count += entered_count;
    push_lists(boxes, counts, sums);
  }

  HWY_INLINE void push_lists(const ChildBoxes& boxes, const uint32_t counts[8], const float sums[8]) {
    float keys[8];
    uint32_t slots[8], size = 0;
    for (uint32_t slot = 0; slot < 8; ++slot) {
      if (counts[slot] == 0) continue;
      const float key = sums[slot] / static_cast<float>(counts[slot]);
      uint32_t i = size++;
      for (; i > 0 && keys[i - 1] < key; --i) keys[i] = keys[i - 1], slots[i] = slots[i - 1];
      keys[i] = key, slots[i] = slot;
    }
    for (uint32_t i = 0; i < size; ++i) {
      const uint32_t slot = slots[i];
      touch_read(meter_, s_.children[slot], counts[slot] * sizeof(StreamItem), TouchKind::kInHand);
      touch_write(meter_, s_.items + s_.used, counts[slot] * sizeof(StreamItem), TouchKind::kInHand);
      touch_write(meter_, &s_.stack[s_.size], sizeof(StreamList), TouchKind::kInHand);
      std::copy_n(s_.children[slot], counts[slot], s_.items + s_.used);
      s_.stack[s_.size++] = {boxes.refs[slot], s_.used, counts[slot]};
      s_.used += counts[slot];
    }
    prefetch_next();
  }

  /// What is on top of the stack comes next.
  HWY_INLINE void prefetch_next() {
    if (s_.size == scope().base || !scope().in_treelet) return;
    const uint32_t ref = s_.stack[s_.size - 1].ref;
    const std::byte* at = is_leaf(ref) ? scope().leaves + size_t{4} * leaf_offset(ref)
                                       : reinterpret_cast<const std::byte*>(scope().nodes + ref);
    touch_ahead(meter_, at, 3, is_leaf(ref) ? TouchKind::kLeaves : TouchKind::kNodes);
    for (int line = 0; line < 3; ++line) hwy::Prefetch(at + 64 * line);
  }

  HWY_INLINE void visit(uint32_t ref) {
    if (scope().in_treelet) return is_leaf(ref) ? cross_leaf(ref) : cross_node(ref);
    const uint32_t child = ref & kIndexMask;
    switch (kind_of(ref)) {
      case ChildKind::kNode:
        return cross_top(child);
      case ChildKind::kEntry:
        return enter_treelet(tables_.entries[child]);
      case ChildKind::kInstance:
        return enter_instance(child);
      case ChildKind::kEmpty:
        return;
    }
  }

  HWY_INLINE void cross_top(uint32_t index) {
    const ChildBoxes boxes(tables_.nodes[index]);
    touch_read(meter_, &tables_.nodes[index], sizeof(TopNode), TouchKind::kTopTree);
    touch_lanes(&LaneUses::top_nodes, boxes);
    cross(boxes);
  }
  HWY_INLINE void cross_node(NodeRef ref) {
    const ChildBoxes boxes(scope().nodes[ref]);
    touch_read(meter_, &scope().nodes[ref], sizeof(QuantizedNode), TouchKind::kNodes);
    touch_lanes(&LaneUses::nodes, boxes);
    cross(boxes);
  }
  /// Every ray of the current list is tested against all children.
  HWY_INLINE void touch_lanes(LaneUse LaneUses::*use, const ChildBoxes& boxes) {
    if constexpr (Meter::kMeters) {
      (meter_.log->lanes.*use).add(static_cast<uint32_t>(std::popcount(boxes.there)) * s_.count, 8 * s_.count);
    }
  }

  HWY_NOINLINE void enter_treelet(const TreeletEntry& entry) {
    const std::byte* page = page_of(tables_, entry.treelet, stream_);
    if (HWY_UNLIKELY(page == nullptr)) return;
    const TreeletView treelet(page);
    touch_read(meter_, &entry, sizeof entry, TouchKind::kTopTree);
    touch_read(meter_, &tables_.pages[entry.treelet], sizeof page, TouchKind::kTopTree);
    touch_read(meter_, &treelet.header->leaves_offset, sizeof(uint32_t), TouchKind::kNodes);
    for (uint32_t i = 0; i < s_.count; ++i) {
      touch_current(i);
      touch_write(meter_, &s_.work[s_.current[i]], sizeof(RayWork), TouchKind::kInHand);
      ++s_.work[s_.current[i]].treelets;
    }
    const RaySpace* spaces = scope().spaces;
    s_.scopes[s_.scope_count++] = {s_.size,      true, spaces, entry, page, page + treelet.header->leaves_offset,
                                   treelet.nodes};
    visit(entry.root);
  }

  HWY_NOINLINE void enter_instance(uint32_t instance) {
    touch_read(meter_, &tables_.instances[instance], sizeof(Instance), TouchKind::kTopTree);
    const uint32_t count = std::exchange(s_.count, 0);
    for (uint32_t i = 0; i < count; ++i) {  // reads ahead of what add_current() writes
      const uint32_t ray = s_.current[i];
      touch_current(i);
      touch_read(meter_, &s_.rays[ray], sizeof(Ray*), TouchKind::kInHand);
      touch_write(meter_, s_.rays[ray], sizeof(Ray), TouchKind::kInHand);
      touch_write(meter_, &s_.object[ray], sizeof(RaySpace), TouchKind::kInHand);
      s_.rays[ray]->instance = instance;
      s_.object[ray] = to_object_space(*s_.rays[ray], tables_.instances[instance]);
      add_current(ray, s_.object[ray]);
    }
    s_.scopes[s_.scope_count++] = {s_.size, false, s_.object, {}, nullptr, nullptr, nullptr};
    cross_top(tables_.instances[instance].root_node);
  }

  HWY_INLINE void cross_leaf(uint32_t ref) {
    const LeafView leaf(scope().leaves + size_t{4} * leaf_offset(ref));
    counters_.simd_lanes_count += uint64_t{16} * s_.count;
    counters_.simd_active_lanes_count += uint64_t{leaf.triangle_count} * s_.count;
    for (uint32_t i = 0; i < s_.count; ++i) {
      const uint32_t ray = s_.current[i];
      touch_current(i);
      touch_candidates(meter_, leaf);
      touch_tested(ray, &s_.object[ray], sizeof(RaySpace));
      s_.work[ray].triangle_tests += leaf.triangle_count;
      const uint32_t candidates = find_candidates<kTest>(s_.object[ray], leaf, s_.rays[ray]->t);
      if (candidates == 0) continue;
      touch_write(meter_, &s_.gone[ray], sizeof s_.gone[ray], TouchKind::kInHand);
      s_.gone[ray] = test_leaf(leaf, leaf_offset(ref), candidates, ray);
    }
  }

  HWY_INLINE void touch_current(uint32_t i) {
    touch_read(meter_, &s_.current[i], sizeof s_.current[i], TouchKind::kInHand);
  }
  /// What a test of boxes or of a leaf reads of a ray of the current list, and where it counts.
  HWY_INLINE void touch_tested(uint32_t ray, const void* space, size_t bytes) {
    touch_read(meter_, space, bytes, TouchKind::kInHand);
    touch_read(meter_, &s_.rays[ray], sizeof(Ray*), TouchKind::kInHand);
    touch_read(meter_, &s_.rays[ray]->t, sizeof(float), TouchKind::kInHand);
    touch_write(meter_, &s_.work[ray], sizeof(RayWork), TouchKind::kInHand);
  }

  /// True when an any-hit ray is done.
  HWY_INLINE bool test_leaf(const LeafView& leaf, uint32_t offset, uint32_t candidates, uint32_t ray) {
    return test_candidates<kTest>(TreeletView(scope().page), leaf, offset, candidates, s_.object[ray],
                                  *s_.rays[ray], scope().entry.treelet, counters_);
  }

  const SceneTables& tables_;
  StreamState& s_;
  RayStream& stream_;
  TraceCounters& counters_;
  [[no_unique_address]] Meter meter_;
};

void stream_watertight(const SceneTables& tables, StreamState& state, RayStream& stream, TraceCounters& counters) {
  StreamWalk<TriangleTest::kWatertight>(tables, state, stream, counters).run();
}
void stream_fast(const SceneTables& tables, StreamState& state, RayStream& stream, TraceCounters& counters) {
  StreamWalk<TriangleTest::kFast>(tables, state, stream, counters).run();
}
void stream_double(const SceneTables& tables, StreamState& state, RayStream& stream, TraceCounters& counters) {
  StreamWalk<TriangleTest::kDouble>(tables, state, stream, counters).run();
}
void stream_touching(const SceneTables& tables, StreamState& state, RayStream& stream, TraceCounters& counters,
                     TouchLog& log) {
  StreamWalk<TriangleTest::kWatertight, TouchMeter>(tables, state, stream, counters, {&log}).run();
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace shoal {

HWY_EXPORT(stream_watertight);
HWY_EXPORT(stream_fast);
HWY_EXPORT(stream_double);
HWY_EXPORT(stream_touching);

namespace {

class StreamTraversal final : public SceneTraversal {
 public:
  StreamTraversal(const TopTree& tree, PageTable pages, TriangleTest test, TouchLog* touches)
      : tree_(tree), pages_(pages), test_(test), touches_(touches), state_(std::make_unique<StreamState>()) {}

  void trace(RayStream& stream, TraceCounters& counters) override {
    const SceneTables tables = scene_tables(tree_, pages_, test_);
    if (tree_.nodes().empty() || exceeds_stacks(tree_)) return trace_all_slowly(tables, stream, counters);
    switch (test_) {
      case TriangleTest::kFast:
        return HWY_DYNAMIC_DISPATCH(stream_fast)(tables, *state_, stream, counters);
      case TriangleTest::kDouble:
        return HWY_DYNAMIC_DISPATCH(stream_double)(tables, *state_, stream, counters);
      case TriangleTest::kWatertight:
        if (HWY_UNLIKELY(touches_ != nullptr)) {
          return HWY_DYNAMIC_DISPATCH(stream_touching)(tables, *state_, stream, counters, *touches_);
        }
        return HWY_DYNAMIC_DISPATCH(stream_watertight)(tables, *state_, stream, counters);
    }
  }

 private:
  const TopTree& tree_;
  PageTable pages_;
  TriangleTest test_;
  TouchLog* touches_;
  std::unique_ptr<StreamState> state_;
};

}  // namespace

std::unique_ptr<SceneTraversal> make_stream_traversal(const TopTree& tree, PageTable pages, TriangleTest test,
                                                      TouchLog* touches) {
  return std::make_unique<StreamTraversal>(tree, pages, test, touches);
}

uint64_t stream_traversal_bytes() { return sizeof(StreamTraversal) + sizeof(StreamState); }

}  // namespace shoal
#endif
