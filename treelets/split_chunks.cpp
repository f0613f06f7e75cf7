#include "treelets/split_chunks.h"

#include <algorithm>
#include <limits>

#include "io/result.h"
#include "treelets/lane_box.h"
#include "treelets/treelet_layout.h"

namespace shoal {
namespace {

/// Below this depth the cells of a range are halved, which ends after 30 levels. Once kMaxPeels splits took less than a
/// part in kPeel, such splits give way to the most even plane. So the tree stays shallow and the parts stay few,
/// wherever the triangles lie.
constexpr uint32_t kMaxSahDepth = 40;
constexpr uint64_t kPeel = 64;
constexpr uint32_t kMaxPeels = 256;

struct Slab {
  float lo[3], hi[3];
  uint64_t count = 0;

  void include(const float* other_lo, const float* other_hi, uint64_t other_count) {
    if (other_count == 0) return;
    for (int axis = 0; axis < 3; ++axis) {
      lo[axis] = count == 0 ? other_lo[axis] : std::min(lo[axis], other_lo[axis]);
      hi[axis] = count == 0 ? other_hi[axis] : std::max(hi[axis], other_hi[axis]);
    }
    count += other_count;
  }
  double cost() const {
    return half_area(lo, hi) * static_cast<double>((count + kMaxLeafTriangles - 1) / kMaxLeafTriangles);
  }
};

struct Range {
  uint32_t begin[3], end[3];
  uint32_t depth;
  uint64_t count;
};

struct Plane {
  double cost = std::numeric_limits<double>::infinity();
  int axis = -1;
  uint32_t at = 0;
  uint64_t left = 0, larger = std::numeric_limits<uint64_t>::max();
};

class Splitter {
 public:
  Splitter(const ChunkGrid& grid, uint64_t chunk_triangles) : grid_(grid), limit_(chunk_triangles) {}

  ChunkPlan split() {
    plan_.part_of_cell.assign(grid_.cells().size(), kNoIndex);
    const uint64_t count = grid_.triangles_count();
    if (count == 0) return std::move(plan_);
    plan_.tree.resize(1);
    split(0, {{0, 0, 0}, {grid_.side(0), grid_.side(1), grid_.side(2)}, 0, count});
    make_chunks();
    return std::move(plan_);
  }

 private:
  template <class Visit>
  void each_cell(const Range& range, const Visit& visit) const {
    uint32_t at[3];
    for (at[2] = range.begin[2]; at[2] < range.end[2]; ++at[2]) {
      for (at[1] = range.begin[1]; at[1] < range.end[1]; ++at[1]) {
        for (at[0] = range.begin[0]; at[0] < range.end[0]; ++at[0]) {
          const uint32_t index = grid_.index(at[0], at[1], at[2]);
          if (grid_.cells()[index].count != 0) visit(index, at);
        }
      }
    }
  }

  void split(uint32_t node, const Range& range) {
    if (range.count > limit_) {
      if (const Plane plane = best_plane(range); plane.axis >= 0) {
        Range left = range, right = range;
        left.end[plane.axis] = right.begin[plane.axis] = plane.at;
        left.count = plane.left, right.count = range.count - plane.left;
        ++left.depth, ++right.depth;
        const auto child = static_cast<uint32_t>(plan_.tree.size());
        plan_.tree[node].left = child;
        plan_.tree.resize(child + 2);
        split(child, left);
        split(child + 1, right);
        return;
      }
    }
    const auto part = static_cast<uint32_t>(plan_.part_triangles.size());
    plan_.tree[node].part = part;
    plan_.part_triangles.push_back(static_cast<uint32_t>(range.count));
    each_cell(range, [&](uint32_t index, const uint32_t*) { plan_.part_of_cell[index] = part; });
  }

  Plane best_plane(const Range& range) {
    std::vector<Slab> slabs[3];
    for (int axis = 0; axis < 3; ++axis) slabs[axis].resize(range.end[axis] - range.begin[axis]);
    each_cell(range, [&](uint32_t index, const uint32_t* at) {
      const ChunkGrid::Cell& cell = grid_.cells()[index];
      for (int axis = 0; axis < 3; ++axis) {
        slabs[axis][at[axis] - range.begin[axis]].include(cell.lo, cell.hi, cell.count);
      }
    });
    if (range.depth >= kMaxSahDepth) return middle_plane(range, slabs);
    Plane cheapest, most_even;
    for (int axis = 0; axis < 3; ++axis) sweep(range, axis, slabs[axis], cheapest, most_even);
    if (cheapest.axis >= 0 && range.count - cheapest.larger < range.count / kPeel && ++peels_ > kMaxPeels) {
      return most_even;
    }
    return cheapest;
  }

  /// Through the middle of the cells that hold something, across the axis with most of them.
  static Plane middle_plane(const Range& range, const std::vector<Slab> slabs[3]) {
    Plane plane;
    uint32_t widest = 1;
    for (int axis = 0; axis < 3; ++axis) {
      uint32_t first = 0, last = static_cast<uint32_t>(slabs[axis].size());
      while (slabs[axis][first].count == 0) ++first;
      while (slabs[axis][last - 1].count == 0) --last;
      if (last - first <= widest) continue;
      widest = last - first;
      plane.axis = axis;
      plane.at = range.begin[axis] + first + widest / 2;
    }
    for (uint32_t i = 0; plane.axis >= 0 && i < plane.at - range.begin[plane.axis]; ++i) {
      plane.left += slabs[plane.axis][i].count;
    }
    return plane;
  }

  static void sweep(const Range& range, int axis, const std::vector<Slab>& slabs, Plane& cheapest, Plane& most_even) {
    std::vector<double> right_cost(slabs.size());
    Slab right, left;
    for (size_t i = slabs.size(); i-- > 1;) {
      right.include(slabs[i].lo, slabs[i].hi, slabs[i].count);
      right_cost[i] = right.count == 0 ? 0 : right.cost();
    }
    for (size_t i = 1; i < slabs.size(); ++i) {
      left.include(slabs[i - 1].lo, slabs[i - 1].hi, slabs[i - 1].count);
      if (left.count == 0 || left.count == range.count || slabs[i - 1].count == 0) continue;
      const uint64_t larger = std::max(left.count, range.count - left.count);
      const Plane plane{left.cost() + right_cost[i], axis, range.begin[axis] + static_cast<uint32_t>(i), left.count,
                        larger};
      if (plane.cost < cheapest.cost || (plane.cost == cheapest.cost && larger < cheapest.larger)) cheapest = plane;
      if (larger < most_even.larger) most_even = plane;
    }
  }

  void make_chunks() {
    plan_.chunk_of_part.resize(plan_.part_triangles.size());
    for (uint32_t part = 0; part < plan_.part_triangles.size(); ++part) {
      const uint64_t count = plan_.part_triangles[part];
      if (plan_.chunks.empty() || plan_.chunks.back().triangles_count + count > limit_) {
        plan_.chunks.push_back({part, part, 0, count > limit_});
      }
      plan_.chunks.back().last_part = part + 1;
      plan_.chunks.back().triangles_count += count;
      plan_.chunk_of_part[part] = static_cast<uint32_t>(plan_.chunks.size() - 1);
    }
  }

  const ChunkGrid& grid_;
  const uint64_t limit_;
  ChunkPlan plan_;
  uint32_t peels_ = 0;
};

}  // namespace

ChunkPlan split_chunks(const ChunkGrid& grid, uint64_t chunk_triangles) {
  SHOAL_CHECK(chunk_triangles > 0);
  return Splitter(grid, chunk_triangles).split();
}

}  // namespace shoal
