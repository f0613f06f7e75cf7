// From the corners of a triangle to the reference that the tree is built over, and which triangles are left out.
// Called by treelets/build_forest and by the engine where it measures triangles for chunks: both must agree.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "treelets/binned_sah.h"

namespace shoal {

/// Corners farther out (or not finite) are skipped: up to here no box, grid plane or edge overflows a float.
inline constexpr float kMaxCoordinate = 0x1p125f;

/// Two corners with equal bits (zeros compared without sign), or a coordinate out of range or not a number.
inline bool is_degenerate(const float* p) {
  uint32_t bits[9];
  for (int i = 0; i < 9; ++i) {
    if (!(std::fabs(p[i]) <= kMaxCoordinate)) return true;
    bits[i] = std::bit_cast<uint32_t>(p[i] + 0.0f);  // -0 + 0 = +0
  }
  const auto equal = [&bits](int a, int b) { return std::equal(bits + 3 * a, bits + 3 * a + 3, bits + 3 * b); };
  return equal(0, 1) || equal(1, 2) || equal(2, 0);
}

inline BuildRef make_triangle_ref(const float* p, uint32_t triangle) {
  BuildRef ref{};
  ref.id = triangle;
  for (int axis = 0; axis < 3; ++axis) {
    // One zero only: the minimum of -0 and +0 would depend on their order.
    ref.lo[axis] = std::min({p[axis], p[axis + 3], p[axis + 6]}) + 0.0f;
    ref.hi[axis] = std::max({p[axis], p[axis + 3], p[axis + 6]}) + 0.0f;
  }
  return ref;
}

/// References to the triangles that are not degenerate, in order; `positions`: nine floats a triangle. Parallel inside.
std::vector<BuildRef> make_refs(std::span<const float> positions);

}  // namespace shoal
