// Which subtrees of the binary tree become treelets. Depth first, top down: the largest subtree that fits the
// page joins it; what does not fit starts the next page, after an underfull page has taken a part of it.
// So most pages hold one or two large neighbouring subtrees, each with a root of its own.
// Called by treelets/build_object. Serial; the cut depends on the input only. Cost: about 10 ns a triangle; more
// where crops must be counted.
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

/// Requires: BinaryNode::bytes holds the packed bytes of the leaves below (without
/// coverage), `starts` are the subtrees to cut, in depth-first order; `order[first + i]` is the i-th triangle of a node.
TreeletCut cut_treelets(std::span<const BinaryNode> tree, std::span<const uint32_t> starts, const WidePlan& plan,
                        std::span<const uint32_t> order, const CoverageCropper& cropper, uint32_t treelet_bytes);

}  // namespace shoal
