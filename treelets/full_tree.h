// A binary tree with one reference a leaf, as treelets/linear_bvh makes it and treelets/restructured_bvh improves
// it, and how it becomes the tree that the rest of the build takes: subtrees of few references are closed to
// leaves. Parallel inside; depends on the input only. Cost: 80 bytes a reference.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "io/huge_memory.h"
#include "treelets/binned_sah.h"

namespace shoal {

/// Nodes [0, 2 * ref_count - 1), the root first; the right child follows the left one, but children need not come
/// after their parent. Of a leaf, `first` is the place of its reference; of other nodes `first` and `bytes` are the
/// builder's.
struct FullTree {
  static constexpr uint64_t kBytesPerRef = 2 * sizeof(BinaryNode);

  explicit FullTree(size_t refs) : nodes(2 * refs - 1), ref_count(refs) {}

  HugeArray<BinaryNode> nodes;
  size_t ref_count;
};

/// Below this many references a subtree is one task.
inline constexpr uint32_t kSerialRefs = 8192;

/// The tree with leaves of at most model.leaf_size references: from the bottom up a subtree becomes a leaf where
/// that costs no more by `model`, as Karras and Aila 2013 do ("Fast Parallel Construction of High-Quality Bounding
/// Volume Hierarchies"). Consumes the tree, and reorders `refs` as its leaves lie.
std::vector<BinaryNode> close_leaves(FullTree&& tree, std::span<BuildRef> refs, const SahModel& model);

}  // namespace shoal
