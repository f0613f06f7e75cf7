// The linear BVH (Lauterbach et al. 2009, "Fast BVH Construction on GPUs"): references in the order of a Morton
// curve, each node split where the highest bit that its codes do not share changes; where codes are equal, by
// their places (Karras 2012, "Maximizing Parallelism in the Construction of BVHs, Octrees, and k-d Trees"). Small
// subtrees are closed to leaves by the rule of treelets/full_tree.h. Rays pay for how little is looked at.
// Called by treelets/bvh_builder. Parallel inside; the tree depends on the input only. Cost: bench/bvh_builders.
#pragma once

#include <span>
#include <vector>

#include "treelets/full_tree.h"

namespace shoal {

/// The tree with a reference a leaf over `refs`, which are sorted along the curve. No leaf is deeper than
/// kMaxBinaryDepth: where bits would lead there, the rest is halved by count. Requires: refs not empty, ids differ.
FullTree build_radix_tree(std::span<BuildRef> refs);

/// close_leaves() of that tree, which is never stored whole. Requires: as build_binary_tree().
std::vector<BinaryNode> build_linear_bvh(std::span<BuildRef> refs, const SahModel& model);

}  // namespace shoal
