// A k-d tree over triangles, the lecture's second answer to visibility: space is cut, not the set of triangles, so
// a triangle may lie in several leaves, and a ray meets leaves in order and stops at the first hit.
//
// Built by the surface-area heuristic after Wald and Havran 2006 ("On building fast kd-Trees for Ray Tracing, and
// on doing that in O(N log N)"): triangles are clipped to the cell ("perfect splits"), all planes at the sides of
// what is left are tried with their events sorted at each node (the O(n log^2 n) variant), cells that get empty
// cost less, triangles in a plane go to the cheaper side. Nodes of more than kSweptRefs references try planes
// between bins of minima and maxima instead (Shevtsov, Soupikov and Kapustin 2007). Nodes are 8 bytes, in
// depth-first order; no mailboxes.
//
// Rays cross planes with both cells as wide as the scene's pad (bench/visible_triangles.h), in double: so every
// cell is visited in which an accepted hit may lie, and the hits are those of the BVH to the bit.
// Called by bench/visibility. Parallel inside (oneTBB); the tree depends on the input only.
#pragma once

#include "bench/visible_triangles.h"

namespace shoal::bench {

struct KdNode {
  static constexpr uint32_t kLeaf = 3;

  union {
    float split;
    uint32_t count;  ///< of a leaf: references
  };
  uint32_t link;  ///< lowest two bits: axis, or kLeaf; above: the right child (the left one comes next), or the
                  ///< first reference

  bool leaf() const { return (link & 3) == kLeaf; }
  uint32_t axis() const { return link & 3; }
  uint32_t index() const { return link >> 2; }
};
static_assert(sizeof(KdNode) == 8);

struct KdCounts {
  uint64_t node_steps = 0, triangle_tests = 0;
};

class KdTree {
 public:
  /// Keeps a reference to `triangles`. Requires: not empty, fewer than 2^30 references in leaves.
  explicit KdTree(const VisibleTriangles& triangles);

  /// Makes ray.t and ray.hit those of the closest hit (the treelet and slot of the hit stay empty).
  void trace(Ray& ray, KdCounts& counts) const;

  uint64_t bytes() const { return nodes_.size() * sizeof(KdNode) + refs_.size() * sizeof(uint32_t); }
  size_t node_count() const { return nodes_.size(); }
  size_t ref_count() const { return refs_.size(); }

 private:
  const VisibleTriangles& triangles_;
  std::vector<KdNode> nodes_;
  std::vector<uint32_t> refs_;  ///< triangles
};

}  // namespace shoal::bench
