// How hot treelets are: how often each was taken in hand, crossed by a ray and read from disk, counted in cells of
// neighbours in the file, so that it takes the same memory for any scene. Called by engine/render_worker and
// engine/treelet_scheduler where a render is recorded (engine/render_record). One count a thread, summed at the end.
// Cost: an addition in a table of 128 KiB for a ray and treelet.
#pragma once

#include <cstdint>
#include <vector>

#include "treelets/ray.h"

namespace shoal {

/// At most so many cells: a square of 64 x 64.
inline constexpr uint32_t kHeatCells = 4096;

struct HeatCell {
  uint64_t batches_count = 0;  ///< treelets taken in hand (treelet_batches_count)
  uint64_t visits_count = 0;   ///< rays that crossed a treelet (treelet_visits_count); not told by the hybrid order
  uint64_t loads_count = 0;    ///< geometry pages read (treelet_loads_count)
  uint64_t load_bytes = 0;     ///< geometry and attribute pages read, decoded
};

class TreeletHeat {
 public:
  explicit TreeletHeat(uint32_t treelets_count = 0) : treelets_count_(treelets_count) {
    while (cells_for(shift_) > kHeatCells) ++shift_;
    cells_.resize(cells_for(shift_));
  }

  HeatCell& of(TreeletId treelet) { return cells_[treelet >> shift_]; }
  void add(const TreeletHeat& other) {
    for (size_t i = 0; i < cells_.size(); ++i) {
      cells_[i].batches_count += other.cells_[i].batches_count;
      cells_[i].visits_count += other.cells_[i].visits_count;
      cells_[i].loads_count += other.cells_[i].loads_count;
      cells_[i].load_bytes += other.cells_[i].load_bytes;
    }
  }
  /// Cell i counts the treelets from i * treelets_a_cell() on.
  const std::vector<HeatCell>& cells() const { return cells_; }
  uint32_t treelets_count() const { return treelets_count_; }
  uint32_t treelets_a_cell() const { return 1u << shift_; }

 private:
  uint64_t cells_for(uint32_t shift) const { return (treelets_count_ + (1ull << shift) - 1) >> shift; }
  uint32_t treelets_count_;
  uint32_t shift_ = 0;
  std::vector<HeatCell> cells_;
};

}  // namespace shoal
