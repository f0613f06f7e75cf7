// The geometry page of one treelet from its subtrees: nodes and leaves in depth-first order, children after their
// parents. Called by treelets/build_object from many threads at once. Pure but for reading coverage.
// Cost: about 0.2 us a triangle.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "io/result.h"
#include "treelets/binned_sah.h"
#include "treelets/collapse_wide.h"
#include "treelets/crop_coverage.h"
#include "treelets/treelet_layout.h"
#include "treelets/triangle_soup.h"

namespace shoal {

struct PackedTreelet {
  std::vector<std::byte> geometry;
  std::vector<NodeRef> roots;       ///< of its units, in their order
  std::vector<uint32_t> triangles;  ///< of the soup, by ordinal
  uint64_t leaves_count = 0;
  double node_area = 0;  ///< half areas of the boxes of its nodes, summed in page order
  double leaf_area = 0;  ///< the same of its leaves
};

/// Packs the subtrees of `unit_roots`. Fails with: what the coverage source returns.
Result<PackedTreelet> pack_treelet(std::span<const BinaryNode> tree, const WidePlan& plan,
                                   std::span<const uint32_t> order, std::span<const uint32_t> unit_roots,
                                   const TriangleSoup& soup, const CoverageCropper& cropper);

}  // namespace shoal
