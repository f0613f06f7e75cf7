// The vertices of a leaf, shared ones once: found again by the bits of their positions; and the bytes of a leaf.
// Called by treelets/build_object (to know a leaf's size before cutting) and treelets/pack_treelet. Pure.
// Cost: about 20 ns a triangle when its positions are in cache.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treelets/treelet_layout.h"
#include "treelets/triangle_soup.h"

namespace shoal {

struct LeafVertices {
  float step;                           ///< TriangleSoup::position_step
  uint32_t triangle_count = 0, vertex_count = 0;
  uint32_t bits[3][kMaxLeafVertices];   ///< [axis][vertex], the floats' bits
  uint8_t index[3][kMaxLeafTriangles];  ///< [corner][triangle]
};

/// `triangles` of the soup, at most kMaxLeafTriangles.
void gather_leaf(const TriangleSoup& soup, std::span<const uint32_t> triangles, LeafVertices& leaf);

/// How a leaf is laid out (treelets/treelet_layout.h); first_ordinal is zero, kLeafCoverage clear. `primitives` are
/// those of its triangles. On the grid where every vertex is, and no axis spans 2^16 steps.
LeafHeader plan_leaf(const LeafVertices& leaf, std::span<const uint32_t> primitives);
/// Appends the leaf's bytes. Requires: `header` is plan_leaf() of the same, but for first_ordinal and kLeafCoverage.
void append_leaf(const LeafVertices& leaf, const LeafHeader& header, std::span<const uint32_t> primitives,
                 std::vector<std::byte>& bytes);

}  // namespace shoal
