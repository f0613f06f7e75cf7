// From two children to eight: which binary nodes become wide nodes. The choice with the least summed area of wide
// nodes, found by dynamic programming (Ylitie, Karras and Laine 2017, "Efficient Incoherent Ray Traversal on GPUs
// Through Compressed Wide BVHs", section 3.1; the leaves are given here):
//   cost(v, 1) = area(v) + split(v, 8)                   v becomes a wide node
//   cost(v, i) = min(split(v, i), cost(v, i - 1))        v is opened into at most i children of the node above
//   split(v, i) = min over k of cost(left, k) + cost(right, i - k)
// On a grid mesh it takes a third fewer nodes than opening the largest child first.
// Called by the treelet packer and the builders of top nodes. Parallel inside; the result depends on the tree only.
// Cost: about 50 ns and 4 bytes a binary node.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treelets/binned_sah.h"
#include "treelets/lane_box.h"

namespace shoal {

inline double half_area(const BinaryNode& node) { return half_area(node.lo, node.hi); }

struct WideChildren {
  uint32_t node[8];
  uint32_t count = 0;
};

class WidePlan {
 public:
  /// Wide nodes down to the leaves of the binary tree. `tree` outlives the plan.
  explicit WidePlan(std::span<const BinaryNode> tree);
  /// Wide nodes down to the nodes with closed[node] != kNoIndex; every path from the root meets one.
  WidePlan(std::span<const BinaryNode> tree, std::span<const uint32_t> closed);

  /// The children of the wide node at binary node `root`, in depth-first order. Requires: root is not closed.
  WideChildren children(uint32_t root) const;
  /// Wide nodes that the subtree of `root` packs into; 0 when it is closed.
  uint32_t count_nodes(uint32_t root) const;

 private:
  struct Costs {
    double at_most[9];  // [i]: cost(v, i)
  };
  bool closed(uint32_t node) const { return closed_.empty() ? tree_[node].leaf() : closed_[node] != kNoIndex; }
  Costs plan(uint32_t node);
  void open(uint32_t node, uint32_t slots, WideChildren& children) const;

  std::span<const BinaryNode> tree_;
  std::span<const uint32_t> closed_;
  // Four bits for each i from 2 to 8: how many of i slots the left child takes, 0: as with i - 1.
  std::vector<uint32_t> choice_;
};

}  // namespace shoal
