// Which subtrees of the binary tree become treelets. Top-down: a subtree whose page fits the target is a unit;
// neighbouring units in depth-first order share a page while it fits. Called by treelets/build_object.
// Serial; the cut depends on the input only. Cost: about 10 ns a triangle; more where crops must be counted.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treelets/binned_sah.h"
#include "treelets/collapse_wide.h"
#include "treelets/crop_coverage.h"

namespace shoal {

struct TreeletCut {
  std::vector<uint32_t> unit_roots;  ///< binary nodes, depth first: together they hold every leaf
  std::vector<uint32_t> page_begin;  ///< page i holds units [page_begin[i], page_begin[i + 1])
  std::vector<uint32_t> page_bytes;  ///< exact size of its geometry page

  size_t page_count() const { return page_bytes.size(); }
  std::span<const uint32_t> page_units(size_t page) const {
    return std::span(unit_roots).subspan(page_begin[page], page_begin[page + 1] - page_begin[page]);
  }
};

/// Requires: BinaryNode::bytes holds the packed bytes of the leaves below (with their primitive ids, without
/// coverage); `order[first + i]` is the i-th triangle of a node.
TreeletCut cut_treelets(std::span<const BinaryNode> tree, const WidePlan& plan, std::span<const uint32_t> order,
                        const CoverageCropper& cropper, uint32_t treelet_bytes);

}  // namespace shoal
