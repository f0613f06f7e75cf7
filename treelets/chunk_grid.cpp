#include "treelets/chunk_grid.h"

#include <algorithm>

#include "io/result.h"

namespace shoal {
namespace {

/// Cells along each axis when the longest has `longest`.
uint64_t sides_of(const double extent[3], double largest, uint32_t longest, uint32_t side[3]) {
  uint64_t cells = 1;
  for (int axis = 0; axis < 3; ++axis) {
    side[axis] = 1;
    if (largest > 0) side[axis] = std::max(1u, static_cast<uint32_t>(longest * (extent[axis] / largest) + 0.5));
    cells *= side[axis];
  }
  return cells;
}

}  // namespace

ChunkGrid::ChunkGrid(const Bounds3& bounds, uint32_t max_cells) {
  SHOAL_CHECK(max_cells > 1);
  double extent[3], largest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    extent[axis] = bounds.empty() ? 0 : static_cast<double>(bounds.hi[axis]) - bounds.lo[axis];
    // Below this the scale would overflow; such extents are flat beside any other.
    if (!(extent[axis] > 0x1p-100)) extent[axis] = 0;
    largest = std::max(largest, extent[axis]);
  }
  uint32_t longest = kMaxSide;
  while (longest > 2 && sides_of(extent, largest, longest, side_) > max_cells) --longest;
  const uint64_t cells = sides_of(extent, largest, longest, side_);
  for (int axis = 0; axis < 3; ++axis) {
    origin_[axis] = bounds.empty() ? 0 : bounds.lo[axis];
    scale_[axis] = extent[axis] > 0 && side_[axis] > 1 ? static_cast<float>(side_[axis] / extent[axis]) : 0.0f;
  }
  cell_count_ = cells;
  cells_.resize(cells);
}

uint32_t ChunkGrid::cell_of(const float* p) const {
  const Vec3 centroid = chunk_centroid(p);
  uint32_t place[3];
  for (int axis = 0; axis < 3; ++axis) {
    const float scaled = (centroid[axis] - origin_[axis]) * scale_[axis];
    const float last = static_cast<float>(side_[axis] - 1);
    place[axis] = static_cast<uint32_t>(std::clamp(scaled, 0.0f, last));
  }
  return index(place[0], place[1], place[2]);
}

void ChunkGrid::add(uint32_t index, const float* p) {
  Cell& cell = cells_[index];
  const bool first = cell.count++ == 0;
  ++triangles_count_;
  for (int axis = 0; axis < 3; ++axis) {
    const float lo = std::min({p[axis], p[axis + 3], p[axis + 6]}), hi = std::max({p[axis], p[axis + 3], p[axis + 6]});
    cell.lo[axis] = first ? lo : std::min(cell.lo[axis], lo);
    cell.hi[axis] = first ? hi : std::max(cell.hi[axis], hi);
  }
}

}  // namespace shoal
