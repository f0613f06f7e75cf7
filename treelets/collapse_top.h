// The binary tree above the treelets (or over instances) as 8-wide nodes of the resident top tree, in depth-first
// order. Called by treelets/build_object and treelets/build_instance_tree. Pure. Cost: about 100 ns a node.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "io/result.h"
#include "treelets/binned_sah.h"
#include "treelets/top_tree.h"

namespace shoal {

/// `leaf_index[node]` is what a child at that binary node leads to (with `kind`), kNoIndex where it is opened
/// further. A root that leads somewhere itself becomes the one child of one node.
std::vector<TopNode> collapse_top(std::span<const BinaryNode> tree, std::span<const uint32_t> leaf_index,
                                  ChildKind kind);

}  // namespace shoal
