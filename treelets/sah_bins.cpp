#include "treelets/sah_bins.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <functional>

namespace shoal {
namespace {

// From here on binning is worth several tasks.
constexpr size_t kParallelBinRefs = 1u << 16;
constexpr size_t kBinGrain = 1u << 14;

// Few references do not fill many bins, and most nodes have few: sweeping empty bins would cost more than adding.
uint32_t choose_bin_count(uint32_t ref_count) {
  if (ref_count <= 16) return 8;
  return ref_count <= 128 ? 16 : kMaxBinCount;
}

}  // namespace

Binning::Binning(const LaneBox& centroids, uint32_t ref_count) : bin_count_(choose_bin_count(ref_count)) {
  float lo[4], hi[4], scale[3];
  lanes_store(centroids.lo, lo), lanes_store(centroids.hi, hi);
  for (int axis = 0; axis < 3; ++axis) {
    const double extent = static_cast<double>(hi[axis]) - lo[axis];
    // Below 2^-120 the scale would overflow; such extents are flat beside any other, and halving serves them.
    const bool flat = !(extent > 0x1p-120);
    scale[axis] = flat ? 0.0f : static_cast<float>(bin_count_ / extent);
    any_axis_ |= !flat;
  }
  origin_ = centroids.lo;
  scale_ = lanes_set(scale[0], scale[1], scale[2]);
  last_ = lanes_set(static_cast<float>(bin_count_ - 1));
}

SahBins::SahBins(uint32_t bin_count) : bin_count_(bin_count) {
  for (auto& axis : count_) std::fill_n(axis, bin_count, 0u);
}

void SahBins::add(std::span<const BuildRef> refs, const Binning& binning) {
  for (const BuildRef& ref : refs) {
    int32_t bin[4];
    binning.bins_of(ref, bin);
    const LaneBox box{lanes_load3(ref.lo), lanes_load3(ref.hi)};
    for (int axis = 0; axis < 3; ++axis) {
      box_[axis][bin[axis]].include(box);
      ++count_[axis][bin[axis]];
    }
  }
}

void SahBins::merge(const SahBins& other) {
  for (int axis = 0; axis < 3; ++axis) {
    for (uint32_t i = 0; i < bin_count_; ++i) {
      box_[axis][i].include(other.box_[axis][i]);
      count_[axis][i] += other.count_[axis][i];
    }
  }
}

SahSplit SahBins::best_split(uint32_t leaf_size) const {
  SahSplit best;
  const auto blocks = [leaf_size](uint32_t n) { return static_cast<double>((n + leaf_size - 1) / leaf_size); };
  for (int axis = 0; axis < 3; ++axis) {
    double right_cost[kMaxBinCount];
    uint32_t right_count[kMaxBinCount];
    LaneBox right;
    uint32_t count = 0;
    for (uint32_t i = bin_count_ - 1; i > 0; --i) {
      right.include(box_[axis][i]);
      count += count_[axis][i];
      right_count[i] = count;
      right_cost[i] = count == 0 ? 0 : half_area(right) * blocks(count);
    }
    LaneBox left;
    count = 0;
    for (uint32_t i = 1; i < bin_count_; ++i) {
      left.include(box_[axis][i - 1]);
      count += count_[axis][i - 1];
      if (count == 0 || right_count[i] == 0) continue;
      const double cost = half_area(left) * blocks(count) + right_cost[i];
      const uint32_t larger = std::max(count, right_count[i]);
      if (cost < best.cost || (cost == best.cost && larger < best.larger_count)) best = {cost, axis, i, larger};
    }
  }
  return best;
}

void SahBins::child_boxes(const SahSplit& split, LaneBox& left, LaneBox& right) const {
  for (uint32_t i = 0; i < bin_count_; ++i) (i < split.bin ? left : right).include(box_[split.axis][i]);
}

void fill_bins(std::span<const BuildRef> refs, const Binning& binning, SahBins& bins) {
  if (refs.size() < kParallelBinRefs) return bins.add(refs, binning);
  // Minima and integer sums are exact: how the range is divided leaves no trace.
  bins = tbb::parallel_reduce(
      tbb::blocked_range<size_t>(0, refs.size(), kBinGrain), SahBins(binning.bin_count()),
      [&](const tbb::blocked_range<size_t>& range, SahBins partial) {
        partial.add(refs.subspan(range.begin(), range.size()), binning);
        return partial;
      },
      [](SahBins a, const SahBins& b) {
        a.merge(b);
        return a;
      });
}

}  // namespace shoal
