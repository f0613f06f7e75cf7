// The binary trees above the treelets of an object that was built in parts, and the tree over the parts: joined into
// one binary tree, so that the top tree is collapsed as if the object had been built at once.
// Called by treelets/build_object and engine/build_chunks. Pure. Cost: about 10 ns a node.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treelets/binned_sah.h"

namespace shoal {

/// Binary trees in one array. A leaf is a subtree that lies in a treelet: its `first` is the entry that leads there.
struct UpperForest {
  std::vector<BinaryNode> nodes;
  std::vector<uint32_t> roots;  ///< of each tree
};

/// A node of the tree over parts. Node 0 is the root, the right child follows the left one.
struct PartNode {
  uint32_t left = kNoIndex;  ///< kNoIndex: a leaf
  uint32_t part = kNoIndex;  ///< of a leaf: its tree in the forest
};

/// Appends the subtree of `from[root]` to `to`, closed where leaf(index) != kNoIndex: that leaf gets it as `first`.
/// The root comes to `place`, which exists already.
template <class Leaf>
void copy_subtree(std::span<const BinaryNode> from, uint32_t root, std::vector<BinaryNode>& to, size_t place,
                  const Leaf& leaf) {
  to[place] = from[root];
  if (const uint32_t first = leaf(root); first != kNoIndex) {
    to[place].left = kNoIndex;
    to[place].first = first;
    return;
  }
  const size_t child = to.size();
  to[place].left = static_cast<uint32_t>(child);
  to.resize(child + 2);
  for (uint32_t i = 0; i < 2; ++i) copy_subtree(from, from[root].left + i, to, child + i, leaf);
}

/// One tree: that over the parts, with each part's own tree in the place of its leaf. Boxes and counts of the nodes
/// above are those of what lies below. Requires: parts not empty.
std::vector<BinaryNode> graft_trees(std::span<const PartNode> parts, const UpperForest& forest);

}  // namespace shoal
