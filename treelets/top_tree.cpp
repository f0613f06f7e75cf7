// clang-format off: the order of these lines matters
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "treelets/top_tree.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>
// clang-format on

#include "treelets/box_kernel-inl.h"
#include "treelets/ray_space.h"
#include "treelets/top_tree.h"

#ifndef SHOAL_TREELETS_TOP_TREE_TABLES
#define SHOAL_TREELETS_TOP_TREE_TABLES
namespace shoal {
/// What next() needs of a TopTree, for the kernel of each target.
struct TopTreeTables {
  const TopNode* nodes;
  const Instance* instances;
  uint32_t more_levels;
  bool single_identity;
  float world_pad_scale, world_extent;
};

/// The space of the tree that the ray's cursor is in.
inline const RaySpace& space_of(const TopTreeTables& tree, const Ray& ray, RayContext& context) {
  if (ray.instance != kNoIndex) return context.object_space(ray, tree.instances[ray.instance]);
  if (!context.world_ready) {
    context.world = prepare_ray(ray.origin, ray.direction);
    const float reach = max_abs(context.world.origin) + tree.world_extent;
    set_pad(context.world, tree.world_pad_scale * reach + std::numeric_limits<float>::min());
    context.world_ready = true;
  }
  return context.world;
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
}  // namespace shoal
#endif

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

HWY_INLINE uint32_t cross_top_node(const RaySpace& ray, const TopNode& node, float t, uint32_t keys[8]) {
  const auto plane = [&](uint32_t side, uint32_t axis, size_t first)
                         HWY_ATTR { return hn::Load(F8(), (side ? node.hi : node.lo)[axis] + first); };
  return cross_boxes(ray, t, plane, keys);
}

/// The key of the next child to enter: the smallest of `mask`, above `after` when the node is met again; kNoIndex:
/// none. Sets `more` to whether others are left behind it.
HWY_INLINE uint32_t choose_child(const uint32_t keys[8], uint32_t mask, bool again, uint32_t after, bool& more) {
  uint32_t best = kNoIndex, count = 0;
  for (; mask != 0; mask &= mask - 1) {
    const uint32_t key = keys[std::countr_zero(mask)];
    if (again && key <= after) continue;
    best = std::min(best, key);
    ++count;
  }
  more = count > 1;
  return best;
}

uint32_t next_entry(const TopTreeTables& tree, Ray& ray, RayContext& context, uint64_t& node_tests) {
  TopPlace place = place_of_cursor(tree, ray, context);
  for (;;) {
    const TopNode& node = tree.nodes[place.node];
    const uint32_t level = place.base + node.level;
    const uint32_t bit = level < tree.more_levels ? 1u << level : 0;
    uint32_t key = kNoIndex;
    if (!place.again || bit == 0 || (ray.more & bit) != 0) {
      ++node_tests;
      uint32_t keys[8];
      const uint32_t mask = cross_top_node(*place.space, node, ray.t, keys);
      bool more;
      key = choose_child(keys, mask, place.again, keys[place.slot], more);
      ray.more = more ? ray.more | bit : ray.more & ~bit;
    }
    if (key == kNoIndex) {
      if (!climb(tree, ray, context, place)) break;
    } else if (descend(tree, ray, context, place, key & 7)) {
      return node.child[key & 7];
    }
  }
  ray.cursor = kNoIndex, ray.instance = kNoIndex, ray.more = 0;
  return kNoIndex;
}

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace shoal {

HWY_EXPORT(next_entry);

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
  single_identity_ = instances_.size() == 1 && instances_[0].identity != 0;
}

uint32_t TopTree::next(Ray& ray, RayContext& context, uint64_t& node_tests) const {
  if (nodes_.empty()) return kNoIndex;
  const TopTreeTables tables{nodes_.data(),    instances_.data(), options_.more_levels,
                             single_identity_, world_pad_scale_,  world_extent_};
  return HWY_DYNAMIC_DISPATCH(next_entry)(tables, ray, context, node_tests);
}

uint32_t TopTree::next(Ray& ray, uint64_t& node_tests) const {
  RayContext context;
  return next(ray, context, node_tests);
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
