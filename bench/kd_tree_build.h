// How bench/kd_tree cuts space: the references of a cell, the plane that costs least, and the two sides. Called by
// bench/kd_tree. Plain functions of their arguments.
#pragma once

#include <vector>

#include "bench/visible_triangles.h"

namespace shoal::bench {

/// A triangle in a cell: the box of the part of it that lies there.
struct KdRef {
  float lo[3], hi[3];
  uint32_t triangle;
};

struct KdCell {
  float lo[3], hi[3];
};

/// Costs of Wald and Havran 2006.
inline constexpr double kKdTraversalCost = 15, kKdTriangleCost = 20;
inline constexpr double kKdEmptyBonus = 0.8;  ///< what a cut costs that leaves a side empty, of what it would
inline constexpr size_t kSweptRefs = 16384;   ///< nodes of so many try every plane, larger ones those between bins

struct KdSplit {
  double cost = 0;  ///< of the node, cut so
  int axis = -1;    ///< below 0: none found
  float plane = 0;
  bool planar_left = false;  ///< what lies in the plane goes left
};

/// The cheapest plane that cuts the cell. Costs are those of a ray that meets the cell.
KdSplit find_split(const KdCell& cell, const std::vector<KdRef>& refs);

/// The references of both sides, those that straddle the plane clipped to each. Consumes `refs`.
void cut_refs(const VisibleTriangles& triangles, const KdCell& cell, const KdSplit& split,
              std::vector<KdRef>&& refs, std::vector<KdRef>& left, std::vector<KdRef>& right);

}  // namespace shoal::bench
