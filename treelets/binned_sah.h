// The binary tree under every treelet: binned SAH (Wald 2007, "On fast Construction of SAH-based Bounding Volume
// Hierarchies") over references, each a box and an id. Called by treelets/build_object (triangles) and
// treelets/build_instance_tree (instances). Parallel inside (oneTBB); the tree depends on the input only: bins are
// merged by exact minima and integer sums, and work is divided by counts, never by threads.
//
// Cost model: one SIMD test takes a block of references, usually a whole leaf, so n of them cost ceil(n / block) tests:
//   cost(split) = split_cost * area + area_left * ceil(n_left / block) + area_right * ceil(n_right / block)
// Counting in blocks also favours full leaves (Embree's logBlockSize does the same).
// Depth never passes kMaxBinaryDepth: where SAH would, the range is halved by count instead.
// Cost: about 0.2 us a reference and thread (bench/build_bvh); 32 bytes a reference and about 20 for nodes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treelets/ray.h"
#include "treelets/vector.h"

namespace shoal {

/// What the tree is built over. Requires: lo <= hi, finite.
struct alignas(16) BuildRef {
  float lo[3];
  uint32_t id;
  float hi[3];
  uint32_t reserved;
};
static_assert(sizeof(BuildRef) == 32);

/// A node of the binary tree over references [first, first + count) of the reordered input.
/// The right child follows the left one; children come after their parent in the array.
struct BinaryNode {
  float lo[3], hi[3];
  uint32_t first, count;
  uint32_t left;   ///< kNoIndex: a leaf
  uint32_t bytes;  ///< for treelets/cut_treelets: packed bytes of the leaves below, saturated

  bool leaf() const { return left == kNoIndex; }
};
static_assert(sizeof(BinaryNode) == 40);

inline constexpr uint32_t kMaxBinaryDepth = 88;  ///< below kMaxTreeletDepth: collapsing only makes it shallower

/// A split of a node that the collapse to 8 children mostly absorbs costs a fraction of a leaf test; what it costs in
/// bytes weighs more. Measured on 320,000 small triangles that share nothing, bytes a triangle and SAH cost:
/// 0.3: 72 and 57.2; 0.5: 50 and 58.6; 0.7: 47 and 59.6; 1.0: 47 and 59.7. Meshes do not mind (24.4 and 29.1).
inline constexpr double kSplitCost = 0.5;

/// What splits and leaves cost.
struct SahModel {
  uint32_t leaf_size;              ///< at most so many references a leaf
  uint32_t block = leaf_size;      ///< references that one test takes; a power of two
  double split_cost = kSplitCost;  ///< of a split that need not be, over the cost of a test
};

/// Reorders `refs` so that every node's references are contiguous. Node 0 is the root. Requires: refs not empty,
/// fewer than 2^31; leaf_size > 0.
std::vector<BinaryNode> build_binary_tree(std::span<BuildRef> refs, const SahModel& model);

}  // namespace shoal
