// From two children to eight: the children that a wide node takes from the binary tree below one of its nodes.
// Greedy: the child with the largest area is opened first, as the likeliest to be entered (Wald et al. 2008,
// "Getting Rid of Packets", section 3.2). Called by treelets/cut_treelets (to count), treelets/pack_treelet and the
// builders of top nodes. Pure. Cost: about 50 ns a wide node.
#pragma once

#include <cstdint>
#include <span>

#include "treelets/binned_sah.h"
#include "treelets/lane_box.h"

namespace shoal {

inline double half_area(const BinaryNode& node) { return half_area(node.lo, node.hi); }

struct WideChildren {
  uint32_t node[8];
  uint32_t count = 0;
};

/// The up to eight descendants of `root` that become the children of one wide node, in depth-first order.
/// `closed(node)` says which binary nodes must not be opened (leaves; roots of treelets). Requires: root is open.
template <class Closed>
WideChildren open_children(std::span<const BinaryNode> tree, uint32_t root, Closed closed) {
  WideChildren children;
  double area[8];  // negative: closed
  const auto place = [&](uint32_t slot, uint32_t node) {
    children.node[slot] = node;
    area[slot] = closed(node) ? -1.0 : half_area(tree[node]);
  };
  place(0, tree[root].left), place(1, tree[root].left + 1);
  children.count = 2;
  while (children.count < 8) {
    uint32_t largest = 0;
    for (uint32_t i = 1; i < children.count; ++i) {
      if (area[i] > area[largest]) largest = i;
    }
    if (area[largest] < 0) break;
    for (uint32_t i = children.count++; i > largest + 1; --i) {
      children.node[i] = children.node[i - 1], area[i] = area[i - 1];
    }
    const uint32_t left = tree[children.node[largest]].left;
    place(largest, left), place(largest + 1, left + 1);
  }
  return children;
}

/// Children down to the leaves of the binary tree.
inline WideChildren open_children(std::span<const BinaryNode> tree, uint32_t root) {
  return open_children(tree, root, [tree](uint32_t node) { return tree[node].leaf(); });
}

/// Wide nodes that the subtree of `root` packs into; 0 for a leaf.
uint32_t count_wide_nodes(std::span<const BinaryNode> tree, uint32_t root);

}  // namespace shoal
