// clang-format off: the order of these lines matters
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "treelets/top_tree.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>
// clang-format on

#include <hwy/cache_control.h>

#include "treelets/box_kernel-inl.h"
#include "treelets/ray_space.h"
#include "treelets/space_kernel-inl.h"
#include "treelets/top_tree.h"
#include "treelets/touch_kernel-inl.h"
#include "treelets/trace_touching.h"

#ifndef SHOAL_TREELETS_TOP_TREE_TABLES
#define SHOAL_TREELETS_TOP_TREE_TABLES
namespace shoal {
/// Rays walked in turn: while one waits for memory or a result the others go on. As many as the treelet kernel has.
inline constexpr uint32_t kWalkLanes = 16;

/// What next() needs of a TopTree, for the kernel of each target.
struct TopTreeTables {
  const TopNode* nodes;
  const Instance* instances;
  uint32_t more_levels;
  bool single_identity;
  float world_pad_scale, world_extent;
};

inline const RaySpace& world_space(const Ray& ray, float pad_scale, float extent, RayContext& context) {
  if (!context.world_ready) {
    context.world = prepare_ray(ray.origin, ray.direction);
    const float reach = max_abs(context.world.origin) + extent;
    set_pad(context.world, pad_scale * reach + std::numeric_limits<float>::min(), reach);
    context.world_ready = true;
  }
  return context.world;
}

/// The space of the tree that the ray's cursor is in.
inline const RaySpace& space_of(const TopTreeTables& tree, const Ray& ray, RayContext& context) {
  if (ray.instance != kNoIndex) return context.object_space(ray, tree.instances[ray.instance]);
  return world_space(ray, tree.world_pad_scale, tree.world_extent, context);
}

/// Where a walk stands: before the children of a node, or behind one of them.
struct TopPlace {
  uint32_t node, slot;
  uint32_t base;  ///< level in the whole path of the root of the tree that the node is in
  bool again;     ///< the node is met again, on the way up: go on behind `slot`
  const RaySpace* space;
};

inline TopPlace place_of_cursor(const TopTreeTables& tree, Ray& ray, RayContext& context) {
  TopPlace place{ray.cursor >> 3, ray.cursor & 7, 0, ray.cursor != kNoIndex, nullptr};
  if (!place.again) {
    ray.instance = tree.single_identity ? 0 : kNoIndex;
    place.node = tree.single_identity ? tree.instances[0].root_node : 0;
  }
  if (ray.instance != kNoIndex && !tree.single_identity) {
    place.base = tree.nodes[tree.instances[ray.instance].tree_child >> 3].level + 1;
  }
  place.space = &space_of(tree, ray, context);
  return place;
}

/// To the parent, from an object's tree to the tree over instances; false at the root of all.
inline bool climb(const TopTreeTables& tree, Ray& ray, RayContext& context, TopPlace& place) {
  uint32_t parent = tree.nodes[place.node].parent;
  if (parent == kNoIndex) {
    if (ray.instance == kNoIndex || tree.single_identity) return false;
    parent = tree.instances[ray.instance].tree_child;
    ray.instance = kNoIndex;
    place.base = 0;
    place.space = &space_of(tree, ray, context);
  }
  place.node = parent >> 3, place.slot = parent & 7, place.again = true;
  return true;
}

/// Into the child in `slot`; true when it is an entry, where the walk rests.
inline bool descend(const TopTreeTables& tree, Ray& ray, RayContext& context, TopPlace& place, uint32_t slot) {
  const TopNode& node = tree.nodes[place.node];
  const uint32_t child = node.child[slot];
  place.slot = slot, place.again = false;
  switch (node.kind[slot]) {
    case ChildKind::kEntry:
      ray.cursor = place.node << 3 | slot;
      return true;
    case ChildKind::kNode:
      place.node = child;
      break;
    case ChildKind::kInstance:
      ray.instance = child;
      place.base += node.level + 1;
      place.node = tree.instances[child].root_node;
      place.space = &space_of(tree, ray, context);
      break;
    case ChildKind::kEmpty:  // never entered in a well-formed tree
      place.again = true;
      break;
  }
  return false;
}

/// What the vector form does, by box_test.h.
inline uint32_t cross_extreme(const RaySpace& ray, const TopNode& node, float t, uint32_t keys[8]) {
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
}  // namespace shoal
#endif

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

/// The next child to enter of a node.
struct ChosenChild {
  uint32_t key;  ///< entry_key(); kNoIndex: none
  bool more;     ///< others are left behind it
};

/// The smallest of the keys in `mask` that lie above `after`; as signed integers, so that -1 lies below all.
HWY_INLINE ChosenChild choose_child(const uint32_t keys[8], uint32_t mask, int32_t after) {
  uint32_t best = kNoIndex, count = 0;
  for (; mask != 0; mask &= mask - 1) {
    const uint32_t key = keys[std::countr_zero(mask)];
    if (static_cast<int32_t>(key) <= after) continue;
    best = std::min(best, key);
    ++count;
  }
  return {best, count > 1};
}

HWY_INLINE BoxLanes cross_top_lanes(const RaySpace& ray, const TopNode& node, float t, size_t first) {
  const auto plane = [&](uint32_t side, uint32_t axis)
                         HWY_ATTR { return hn::Load(F8(), (side != 0 ? node.hi : node.lo)[axis] + first); };
  return cross_boxes(ray, t, ray.slope, ray.near_bias, ray.far_bias, first, plane);
}

/// Tests the children of a node: the nearest that the ray enters, behind the one in place.slot if it is met again.
HWY_INLINE ChosenChild cross_top_node(const TopNode& node, const TopPlace& place, float t) {
  const RaySpace& ray = *place.space;
  HWY_ALIGN uint32_t keys[8];
  if (HWY_UNLIKELY(ray.extreme)) {
    const uint32_t mask = cross_extreme(ray, node, t, keys);
    return choose_child(keys, mask, place.again ? static_cast<int32_t>(keys[place.slot]) : -1);
  }
#if HWY_MAX_BYTES >= 32
  const U8 u;
  const hn::RebindToSigned<U8> i;
  const BoxLanes boxes = cross_top_lanes(ray, node, t, 0);
  hn::Store(boxes.key, u, keys);
  const int32_t after = place.again ? static_cast<int32_t>(keys[place.slot]) : -1;
  const auto left =
      hn::And(hn::RebindMask(i, boxes.entered), hn::Gt(hn::BitCast(i, boxes.key), hn::Set(i, after)));
  const auto least = hn::MinOfLanes(u, hn::IfThenElse(hn::RebindMask(u, left), boxes.key, hn::Set(u, kNoIndex)));
  return {hn::GetLane(least), hn::CountTrue(i, left) > 1};
#else
  uint32_t mask = 0;
  for (size_t first = 0; first < 8; first += hn::Lanes(F8())) {
    const BoxLanes boxes = cross_top_lanes(ray, node, t, first);
    hn::StoreU(boxes.key, U8(), keys + first);
    uint8_t bits[8] = {};
    hn::StoreMaskBits(F8(), boxes.entered, bits);
    mask |= uint32_t{bits[0]} << first;
  }
  return choose_child(keys, mask, place.again ? static_cast<int32_t>(keys[place.slot]) : -1);
#endif
}

/// A ray on its way through the top tree.
struct WalkLane {
  NextJob* job;
  TopPlace place;
  ChosenChild chosen;
  uint32_t bit;  ///< of Ray::more for the level of the node
};

/// `Meter`: NoTouches, or TouchMeter to tell what is touched (treelets/touch_log.h).
template <class Meter = NoTouches>
class Walker {
 public:
  Walker(const TopTreeTables& tree, std::span<NextJob> jobs, Meter meter = {})
      : tree_(tree), jobs_(jobs), meter_(meter) {}

  HWY_INLINE void run() {
    for (uint32_t lane = 0; lane < kWalkLanes && next_job_ < jobs_.size(); ++lane) {
      if (start(lanes_[active_])) ++active_;
    }
    while (active_ > 0) {
      for (uint32_t i = 0; i < active_; ++i) {
        WalkLane& lane = lanes_[i];
        touch_ray(meter_, lane, *lane.place.space, *lane.job->ray, lane.job->node_tests, true);
        touch_top_boxes(meter_, tree_.nodes[lane.place.node]);
        lane.chosen = cross_top_node(tree_.nodes[lane.place.node], lane.place, lane.job->ray->t);
      }
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
  /// Puts the next job into the lane; false when none is left that needs a test.
  HWY_INLINE bool start(WalkLane& lane) {
    while (next_job_ < jobs_.size()) {
      lane.job = &jobs_[next_job_++];
      Ray& ray = *lane.job->ray;
      RayContext& context = *lane.job->context;
      touch_walk(meter_, *lane.job, lane);
      if (tree_.single_identity && context.object_instance != 0) {
        prepare_identity(ray, tree_.instances[0].max_abs_coordinate, context.object);
        context.object_instance = 0;
      }
      lane.place = place_of_cursor(tree_, ray, context);
      if (settle(lane)) return true;
    }
    return false;
  }

  /// From a node met again, up to the nearest that has children left; false at the end: the ray leaves the tree.
  HWY_INLINE bool settle(WalkLane& lane) {
    Ray& ray = *lane.job->ray;
    for (;;) {
      const TopNode& node = tree_.nodes[lane.place.node];
      touch_read(meter_, &node.parent, 8, TouchKind::kTopTree);  // and level
      const uint32_t level = lane.place.base + node.level;
      lane.bit = level < tree_.more_levels ? 1u << level : 0;
      if (!lane.place.again || lane.bit == 0 || (ray.more & lane.bit) != 0) {
        ++lane.job->node_tests;
        return true;
      }
      if (!climb(tree_, ray, *lane.job->context, lane.place)) return leave(lane);
    }
  }

  HWY_INLINE bool leave(WalkLane& lane) {
    Ray& ray = *lane.job->ray;
    ray.cursor = kNoIndex, ray.instance = kNoIndex, ray.more = 0;
    lane.job->entry = kNoIndex;
    return false;
  }

  /// After a test: to the next place; false when the ray has found its entry, or left.
  HWY_INLINE bool go_on(WalkLane& lane) {
    Ray& ray = *lane.job->ray;
    RayContext& context = *lane.job->context;
    const ChosenChild chosen = lane.chosen;
    ray.more = chosen.more ? ray.more | lane.bit : ray.more & ~lane.bit;
    if (chosen.key == kNoIndex) {
      return climb(tree_, ray, context, lane.place) ? settle(lane) : leave(lane);
    }
    const TopNode& node = tree_.nodes[lane.place.node];
    touch_read(meter_, node.child, sizeof node - offsetof(TopNode, child), TouchKind::kTopTree);
    if (descend(tree_, ray, context, lane.place, chosen.key & 7)) {
      lane.job->entry = node.child[chosen.key & 7];
      return false;
    }
    const auto* below = reinterpret_cast<const std::byte*>(tree_.nodes + lane.place.node);
    for (int line = 0; line < 4; ++line) hwy::Prefetch(below + 64 * line);
    touch_ahead(meter_, below, 4, TouchKind::kTopTree);
    return settle(lane);
  }

  const TopTreeTables& tree_;
  std::span<NextJob> jobs_;
  [[no_unique_address]] Meter meter_;
  size_t next_job_ = 0;
  uint32_t active_ = 0;
  WalkLane lanes_[kWalkLanes];
};

void next_entries(const TopTreeTables& tree, std::span<NextJob> jobs) { Walker<>(tree, jobs).run(); }
void next_touching(const TopTreeTables& tree, std::span<NextJob> jobs, TouchLog& log) {
  Walker<TouchMeter>(tree, jobs, {&log}).run();
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace shoal {

HWY_EXPORT(next_entries);
HWY_EXPORT(next_touching);

namespace {

float row_sum(const Affine3& m) {
  float largest = 0;
  for (int row = 0; row < 3; ++row) {
    largest = std::max(largest, std::abs(m.column_x[row]) + std::abs(m.column_y[row]) + std::abs(m.column_z[row]));
  }
  return largest;
}

}  // namespace

TopTree::TopTree(std::vector<TopNode> nodes, std::vector<TreeletEntry> entries, std::vector<Instance> instances,
                 TraversalOptions options)
    : nodes_(std::move(nodes)), entries_(std::move(entries)), instances_(std::move(instances)), options_(options) {
  options_.more_levels = std::min(options_.more_levels, 32u);
  float largest_error = 1;
  for (const Instance& instance : instances_) {
    const Affine3& m = instance.object_to_world;
    largest_error = std::max(largest_error, instance.transform_error);
    world_extent_ = std::max(world_extent_, max_abs(&m.translation.x) + row_sum(m) * instance.max_abs_coordinate);
  }
  world_pad_scale_ = kWorldPad * largest_error;
  const auto is_key = [](const Instance& row) { return row.tree_child == kNoIndex; };
  const auto first_key = std::find_if(instances_.begin(), instances_.end(), is_key);
  instance_count_ = static_cast<uint32_t>(first_key - instances_.begin());
  single_identity_ = instance_count_ == 1 && instances_.size() == 1 && instances_[0].identity != 0;
}

void TopTree::next(std::span<NextJob> jobs) const {
  if (nodes_.empty()) {
    for (NextJob& job : jobs) job.entry = kNoIndex;
    return;
  }
  const TopTreeTables tables{nodes_.data(),    instances_.data(), options_.more_levels,
                             single_identity_, world_pad_scale_,  world_extent_};
  HWY_DYNAMIC_DISPATCH(next_entries)(tables, jobs);
}

void next_entries_touching(const TopTree& tree, std::span<NextJob> jobs, TouchLog& log) {
  if (tree.nodes().empty()) return tree.next(jobs);
  if (!tree.single_identity()) {  // prepared here, so that the walk needs no pad for it
    for (const NextJob& job : jobs) tree.world_space(*job.ray, *job.context);
  }
  const TopTreeTables tables{tree.nodes().data(), tree.instances().data(), tree.more_levels(), tree.single_identity(),
                             0, 0};
  HWY_DYNAMIC_DISPATCH(next_touching)(tables, jobs, log);
}

uint32_t TopTree::next(Ray& ray, RayContext& context, uint64_t& node_tests) const {
  NextJob job{&ray, &context};
  next({&job, 1});
  node_tests += job.node_tests;
  return job.entry;
}

uint32_t TopTree::next(Ray& ray, uint64_t& node_tests) const {
  RayContext context;
  return next(ray, context, node_tests);
}

const RaySpace& TopTree::world_space(const Ray& ray, RayContext& context) const {
  return shoal::world_space(ray, world_pad_scale_, world_extent_, context);
}

Bounds3 TopTree::bounds() const {
  Bounds3 bounds;
  if (nodes_.empty()) return bounds;
  const TopNode& root = nodes_[0];
  for (int slot = 0; slot < 8; ++slot) {
    if (root.kind[slot] == ChildKind::kEmpty) continue;
    bounds.include(Bounds3{{root.lo[0][slot], root.lo[1][slot], root.lo[2][slot]},
                           {root.hi[0][slot], root.hi[1][slot], root.hi[2][slot]}});
  }
  return bounds;
}

uint64_t TopTree::resident_bytes() const {
  return nodes_.size() * sizeof(TopNode) + entries_.size() * sizeof(TreeletEntry) +
         instances_.size() * sizeof(Instance);
}

}  // namespace shoal
#endif
