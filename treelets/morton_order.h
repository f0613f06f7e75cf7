// References in the order of a Morton curve through their centroids: 21 bits an axis, 63 in all (Lauterbach et al. 2009,
// "Fast BVH Construction on GPUs"). The cells of the curve are cubes: the longest side of the centroids' box has all 21
// bits (docs/decisions/0029-builders-to-compare.md).
// Called by treelets/linear_bvh and treelets/restructured_bvh. Parallel inside (oneTBB); equal codes are ordered by id,
// so the order depends on the input only. Cost: about 0.1 us a reference and thread; 48 bytes a reference while it
// sorts.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treelets/binned_sah.h"

namespace shoal {

inline constexpr uint32_t kMortonBits = 21;  ///< an axis

/// x is the highest of every three bits. Requires: each below 2^21.
uint64_t morton_code(uint32_t x, uint32_t y, uint32_t z);

/// Sorts `refs` along the curve, ids deciding where codes are equal (requires: ids differ). Returns their codes.
std::vector<uint64_t> order_along_curve(std::span<BuildRef> refs);

}  // namespace shoal
