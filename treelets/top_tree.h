// The resident top tree: one array of 8-wide nodes for the tree over instances and for the tree of every object
// over its treelets. It says which treelet a ray enters next, front to back.
//
//   start: cursor = kNoIndex           next() -> first treelet entry, or nothing: the ray misses
//   again: cursor = last child taken   next() -> the entry after it whose box begins at or before ray.t
//
// Called by engine/render_* between treelets. Immutable while rendering, any number of threads.
// Cost: one test of 8 boxes a node on the way down, and one on the way up for each node with children left.
//
// Boxes: lo/hi are the children's bounds in float. The test (treelets/box_test.h) widens the ray by
// RaySpace::pad, so that whatever the triangle test accepts, every box above it accepts.
//
// At every node the children that the ray enters are taken in the order of entry_key() (treelets/box_test.h: t of
// entry without its last three bits, then slot), which depends on ray and node alone.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "io/result.h"
#include "treelets/ray.h"
#include "treelets/vector.h"

namespace shoal {

enum class ChildKind : uint8_t { kEmpty = 0, kNode = 1, kEntry = 2, kInstance = 3 };

struct alignas(64) TopNode {  // 256 bytes
  float lo[3][8];             //   0  [axis][slot]; an empty slot has lo = +inf, hi = -inf
  float hi[3][8];             //  96
  uint32_t child[8];          // 192  index of a node, an entry or an instance
  uint32_t parent;            // 224  (parent node << 3 | slot), kNoIndex at the root of a tree
  uint32_t level;             // 228  0 at the root of its own tree
  ChildKind kind[8];          // 232
  uint32_t reserved[4];       // 240  zero
};
static_assert(sizeof(TopNode) == 256);

/// Where a leaf of an object's tree leads: a root inside a treelet.
struct TreeletEntry {
  TreeletId treelet = 0;
  uint32_t root = 0;  ///< a NodeRef of treelets/treelet_layout.h
};
static_assert(sizeof(TreeletEntry) == 8);

/// The table holds the instances, then the keys of those that move (treelets/moving_instance.h): a key says where its
/// instance stands at one time, and no node leads to it (tree_child: kNoIndex).
struct Instance {  // 128 bytes, as stored
  Affine3 object_to_world;
  Affine3 world_to_object;  ///< computed in double, rounded once
  uint32_t root_node;       ///< global index of the object's root node
  uint32_t tree_child;      ///< (node << 3 | slot) of the tree over instances that leads here
  uint32_t identity;        ///< 1: world and object space are the same bits
  uint32_t object;
  float transform_error;     ///< K of docs/design.md "Numerics": max row sum of |M| |M^-1|, 1 for identity
  float max_abs_coordinate;  ///< of the object's bounds, object space
  uint32_t motion_rows;      ///< it moves: rows of the table from here to its first key; 0: it stands still
  uint32_t key_count;        ///< of an instance that moves: 2 at least; else 0

  bool moves() const { return motion_rows != 0; }
};
static_assert(sizeof(Instance) == 128);

struct TraversalOptions {
  uint32_t more_levels = 32;  ///< levels for which Ray::more is used, 0..32; less is slower, never different
};

struct RayContext;  // treelets/ray_space.h, as RaySpace
struct RaySpace;

/// One ray in search of its next treelet.
struct NextJob {
  Ray* ray;
  RayContext* context;  ///< of this ray, kept while a worker has it in hand
  uint32_t entry = kNoIndex;  ///< found: index of the entry; kNoIndex: there is none
  uint32_t node_tests = 0;    ///< of this job, counted up
};

class TopTree {
 public:
  TopTree() = default;
  /// Requires: indices checked (check()). The root of the tree over instances is node 0.
  TopTree(std::vector<TopNode> nodes, std::vector<TreeletEntry> entries, std::vector<Instance> instances,
          TraversalOptions options = {});

  /// Checks every index, kind, parent link and level of tables read from a file. Fails with: kCorrupt.
  static Status check(std::span<const TopNode> nodes, std::span<const TreeletEntry> entries,
                      std::span<const Instance> instances, uint32_t treelet_count);

  /// Moves the ray's cursor to the next treelet entry whose box the ray enters at or before ray.t, and
  /// returns the entry's index, or kNoIndex when there is none (the cursor is then as before the start).
  /// Many rays in one call are faster than one in many calls: they are walked several at once, in turn.
  void next(std::span<NextJob> jobs) const;
  /// One ray; `node_tests` counts nodes tested.
  uint32_t next(Ray& ray, uint64_t& node_tests) const;
  /// The same for a worker that keeps `context` while it has this ray in hand: saves transforms and reciprocals.
  uint32_t next(Ray& ray, RayContext& context, uint64_t& node_tests) const;

  const TreeletEntry& entry(uint32_t index) const { return entries_[index]; }
  /// The entry a ray's cursor stands on. Requires: next() returned one for this ray.
  const TreeletEntry& current(const Ray& ray) const {
    return entries_[nodes_[ray.cursor >> 3].child[ray.cursor & 7]];
  }
  const Instance& instance(uint32_t index) const { return instances_[index]; }
  uint32_t instance_count() const { return instance_count_; }
  bool moves() const { return instance_count_ < instances_.size(); }
  std::span<const TopNode> nodes() const { return nodes_; }
  std::span<const TreeletEntry> entries() const { return entries_; }
  std::span<const Instance> instances() const { return std::span(instances_).first(instance_count_); }
  Bounds3 bounds() const;  ///< of the scene, world space
  uint64_t resident_bytes() const;
  uint32_t more_levels() const { return options_.more_levels; }
  /// One instance whose space is the world: its tree is the whole top tree.
  bool single_identity() const { return single_identity_; }
  /// The ray in the space of the tree over instances, kept in its context.
  const RaySpace& world_space(const Ray& ray, RayContext& context) const;

 private:
  std::vector<TopNode> nodes_;
  std::vector<TreeletEntry> entries_;
  std::vector<Instance> instances_;  // and behind them the keys of those that move
  uint32_t instance_count_ = 0;
  TraversalOptions options_;
  float world_pad_scale_ = 0;     ///< kWorldPad times the largest transform_error; see ray_space.h
  float world_extent_ = 0;        ///< E of ray_space.h, the largest of all instances
  bool single_identity_ = false;  ///< one instance whose space is the world: its tree is entered at once
};

}  // namespace shoal
