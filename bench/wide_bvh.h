// Trees with 8 children a node in memory, as two builders make them from the same references: Embree's rtcBuildBVH, and
// ours. Both write the nodes below, so that storing costs both the same and one formula measures both.
// Used by bench/build_bvh and bench/build_rate. Parallel inside, by as many threads as oneTBB gives.
#pragma once

#include <embree3/rtcore.h>

#include <cstdint>
#include <memory>
#include <span>

#include "treelets/triangle_refs.h"

namespace shoal::bench {

struct WideLeaf {
  uint32_t count;
  uint32_t id[];  ///< of the triangles
};

/// A child is a node, or a leaf with the lowest bit of its address set.
struct WideNode {
  uint32_t count;
  float lo[8][3], hi[8][3];
  uintptr_t child[8];

  static bool is_leaf(uintptr_t child) { return (child & 1) != 0; }
  static const WideLeaf& leaf(uintptr_t child) { return *reinterpret_cast<const WideLeaf*>(child & ~uintptr_t{1}); }
};

/// A tree by the surface-area heuristic: tests expected of a line that meets its root.
struct WideCost {
  double tests = 0;  ///< areas over the root's: of nodes, and of leaves for each block of their triangles begun
  uint64_t nodes_count = 0, leaves_count = 0, triangles_count = 0;
};
/// Of the tree at `root`, a child as in WideNode.
WideCost measure_cost(uintptr_t root, uint32_t block);

struct SahSettings {
  uint32_t leaf_size = 0;  ///< at most this many triangles a leaf
  uint32_t block = 1;      ///< triangles of one test
};

/// Wall-clock seconds and the processor's over all threads.
struct Spent {
  double seconds = 0, cpu_seconds = 0;
};

/// The references as Embree takes them.
HugeArray<RTCBuildPrimitive> primitives_of(std::span<const BuildRef> refs);

/// Embree's builder: medium quality, branching 8, costs of 1 a node and 1 a block. Consumes the primitives.
class EmbreeBvh {
 public:
  EmbreeBvh(RTCDevice device, HugeArray<RTCBuildPrimitive> primitives, size_t count, const SahSettings& settings);
  ~EmbreeBvh();
  EmbreeBvh(const EmbreeBvh&) = delete;
  EmbreeBvh& operator=(const EmbreeBvh&) = delete;

  uintptr_t root() const { return root_; }  ///< 0 when Embree failed
  const Spent& spent() const { return spent_; }

 private:
  RTCBVH bvh_;
  uintptr_t root_;
  Spent spent_;
};

/// Our builder. Consumes the references.
class OurBvh {
 public:
  OurBvh(RefArray refs, const SahModel& model);
  ~OurBvh();

  uintptr_t root() const { return root_; }
  const Spent& spent() const { return spent_; }            ///< all of it
  double tree_seconds() const { return tree_seconds_; }    ///< of which: references to the binary tree
  double plan_seconds() const { return plan_seconds_; }    ///< of which: which of its nodes become wide ones
  double store_seconds() const { return store_seconds_; }  ///< of which: writing wide nodes and leaves

 private:
  class Arenas;
  std::unique_ptr<Arenas> arenas_;
  uintptr_t root_ = 0;
  Spent spent_;
  double tree_seconds_ = 0, plan_seconds_ = 0, store_seconds_ = 0;
};

}  // namespace shoal::bench
