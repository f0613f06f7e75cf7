// The linear BVH improved by restructuring (Karras and Aila 2013, "Fast Parallel Construction of High-Quality
// Bounding Volume Hierarchies"): from the bottom up, each node takes the kPatchLeaves subtrees that are opened by
// area below it, and the nodes above them are put together in the way that costs least, found by dynamic
// programming over all subsets. Several rounds, each over larger subtrees. What they call a treelet
// is a **patch** here: a treelet is something else in this program.
// Called by treelets/bvh_builder. Parallel inside: subtrees do not touch each other and a node comes after all
// below it, so that the tree depends on the input only. Cost: about 1.5 us a patch; bench/bvh_builders.
#pragma once

#include <span>
#include <vector>

#include "treelets/full_tree.h"

namespace shoal {

inline constexpr uint32_t kPatchLeaves = 7;  ///< n of the paper, which measures 5 to 8 and takes 7

/// Costs and rounds; those of the paper.
struct RestructureModel {
  double node_cost = 1.2;      ///< Ci: of a node, a unit of its area
  double triangle_cost = 1.0;  ///< Ct: of each triangle of a leaf
  uint32_t rounds = 3;
  uint32_t least_refs =
      kPatchLeaves;  ///< gamma: of a subtree that is restructured in the first round; doubles each round
};

/// Improves the tree in place. No leaf gets deeper than kMaxBinaryDepth.
void restructure(FullTree& tree, const RestructureModel& model = {});

/// Requires: as build_binary_tree().
std::vector<BinaryNode> build_restructured_bvh(std::span<BuildRef> refs, const SahModel& model);

}  // namespace shoal
