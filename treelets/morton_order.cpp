#include "treelets/morton_order.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>

#include "io/huge_memory.h"
#include "treelets/partition_refs.h"

namespace shoal {
namespace {

struct MortonKey {
  uint64_t code;
  uint32_t id;
  uint32_t place;  // of the reference before sorting

  bool operator<(const MortonKey& other) const { return code != other.code ? code < other.code : id < other.id; }
};

/// Puts two zero bits before each of the lower 21.
uint64_t spread_bits(uint64_t v) {
  v = (v | v << 32) & 0x001f00000000ffffull;
  v = (v | v << 16) & 0x001f0000ff0000ffull;
  v = (v | v << 8) & 0x100f00f00f00f00full;
  v = (v | v << 4) & 0x10c30c30c30c30c3ull;
  return (v | v << 2) & 0x1249249249249249ull;
}

/// Cells of the curve. In double: no box of floats over- or underflows.
class CurveGrid {
 public:
  explicit CurveGrid(const LaneBox& centroids) {
    const Bounds3 box = centroids.bounds();
    double longest = 0;
    for (int axis = 0; axis < 3; ++axis) {
      origin_[axis] = box.lo[axis];
      longest = std::max(longest, static_cast<double>(box.hi[axis]) - box.lo[axis]);
    }
    scale_ = longest > 0 ? kCells / longest : 0;
  }

  uint64_t code_of(const BuildRef& ref) const {
    float centroid[4];
    lanes_store(binning_centroid(ref), centroid);
    uint32_t cell[3];
    for (int axis = 0; axis < 3; ++axis) {
      cell[axis] = static_cast<uint32_t>(std::min((centroid[axis] - origin_[axis]) * scale_, kCells - 1));
    }
    return morton_code(cell[0], cell[1], cell[2]);
  }

 private:
  static constexpr double kCells = 1u << kMortonBits;
  double origin_[3];
  double scale_;
};

}  // namespace

uint64_t morton_code(uint32_t x, uint32_t y, uint32_t z) {
  return spread_bits(x) << 2 | spread_bits(y) << 1 | spread_bits(z);
}

std::vector<uint64_t> order_along_curve(std::span<BuildRef> refs) {
  const size_t count = refs.size();
  LaneBox box, centroids;
  measure_refs(refs, box, centroids);
  const CurveGrid grid(centroids);
  HugeArray<MortonKey> keys(count);
  tbb::parallel_for(size_t{0}, count, [&](size_t i) {
    keys[i] = {grid.code_of(refs[i]), refs[i].id, static_cast<uint32_t>(i)};
  });
  tbb::parallel_sort(keys.data(), keys.data() + count);
  const HugeArray<BuildRef> copy(count);
  tbb::parallel_for(size_t{0}, count, [&](size_t i) { copy[i] = refs[i]; });
  std::vector<uint64_t> codes(count);
  tbb::parallel_for(size_t{0}, count, [&](size_t i) {
    refs[i] = copy[keys[i].place];
    codes[i] = keys[i].code;
  });
  return codes;
}

}  // namespace shoal
