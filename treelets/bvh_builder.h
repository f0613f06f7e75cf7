// The builders of binary trees behind one function: references in, a tree over them out. What follows is the same
// for all of them: the choice of wide nodes, the cut into treelets, the packing; so pages, kernels and orders are
// too.
// Called by treelets/build_forest. Parallel inside; the tree depends on the input only, never on the number of
// threads. Cost: measured by bench/bvh_builders (docs/decisions/0029-builders-to-compare.md).
#pragma once

#include <span>
#include <vector>

#include "treelets/binned_sah.h"
#include "treelets/bvh_builder_kind.h"

namespace shoal {

/// Reorders `refs` so that every node's references are contiguous; node 0 is the root, children come after their
/// parent, no leaf lies deeper than kMaxBinaryDepth. Requires: as build_binary_tree().
std::vector<BinaryNode> build_tree(BvhBuilder builder, std::span<BuildRef> refs, const SahModel& model);

/// Bytes a reference that this builder takes at once beside the references and the tree that comes out: an upper
/// bound.
uint64_t builder_scratch_bytes(BvhBuilder builder);

}  // namespace shoal
