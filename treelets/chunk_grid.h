// Triangles counted into the cells of a uniform grid by the centroid of their box, with the exact box of what each cell
// got: what an object that does not fit in memory is split by. Called by engine/build_chunks while triangles stream by.
// Counting belongs to one thread; cell_of() may be asked by many. Boxes and counts are exact, so the order of the
// triangles leaves no trace. Cost: 28 bytes a cell, about 10 ns a triangle.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treelets/vector.h"

namespace shoal {

/// A quarter of lo + hi of the box of a triangle, as in treelets/sah_bins.h: no difference of two overflows.
inline Vec3 chunk_centroid(const float* p) {
  Vec3 c;
  for (int axis = 0; axis < 3; ++axis) {
    const float lo = std::min({p[axis], p[axis + 3], p[axis + 6]}), hi = std::max({p[axis], p[axis + 3], p[axis + 6]});
    c[axis] = 0.25f * lo + 0.25f * hi;
  }
  return c;
}

class ChunkGrid {
 public:
  struct Cell {
    float lo[3], hi[3];  ///< of the triangles counted; meaningless while count is 0
    uint32_t count = 0;
  };
  static constexpr uint64_t kCellBytes = sizeof(Cell);
  static constexpr uint32_t kMaxSide = 1024;  ///< cells along an axis

  /// Cells are about cubes and at most `max_cells`; `centroids` holds chunk_centroid() of every triangle (what lies
  /// outside falls into the cells at the border). Two centroids at opposite ends of it fall into different cells, so
  /// that cutting again and again comes to an end. Requires: max_cells > 1.
  ChunkGrid(const Bounds3& centroids, uint32_t max_cells);

  /// The cell of a triangle with corners p (9 floats, stored: see treelets/triangle_refs.h).
  uint32_t cell_of(const float* p) const;
  void add(uint32_t cell, const float* p);

  uint32_t side(int axis) const { return side_[axis]; }
  uint32_t index(uint32_t x, uint32_t y, uint32_t z) const { return (z * side_[1] + y) * side_[0] + x; }
  std::span<const Cell> cells() const { return cells_; }
  uint64_t triangles_count() const { return triangles_count_; }
  /// False when no grid can tell the triangles apart: their centroids are all in one place.
  bool divides() const { return cell_count_ > 1; }
  /// Frees the cells; cell_of() still works.
  void forget_counts() { cells_ = {}; }

 private:
  uint32_t side_[3] = {1, 1, 1};
  float origin_[3], scale_[3];
  uint64_t triangles_count_ = 0, cell_count_ = 0;
  std::vector<Cell> cells_;
};

}  // namespace shoal
