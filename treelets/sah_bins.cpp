#include "treelets/sah_bins.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <bit>
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

// Half the area of three boxes, one a lane, times the square of `scale`.
Lanes scaled_areas(const LaneBox box[3], Lanes scale) {
  Lanes products[3];
  for (int axis = 0; axis < 3; ++axis) {
    const Lanes extent = lanes_mul(lanes_sub(box[axis].hi, box[axis].lo), scale);
    products[axis] = lanes_mul(extent, lanes_rotate3(extent));
  }
  return lanes_sum3(products);
}

// The power of two that takes the longest side of a box to between one and two, so that areas fit floats; flat boxes as
// if they were 2^-120 long.
float area_scale(const LaneBox& box) {
  float extent[4];
  lanes_store(lanes_sub(box.hi, box.lo), extent);
  const float longest = std::max({extent[0], extent[1], extent[2], 0x1p-120f});
  const uint32_t exponent = std::bit_cast<uint32_t>(longest) >> 23;  // biased by 127, as that of the scale
  return std::bit_cast<float>((2 * 127 - exponent) << 23);
}

// The cheapest of the planes of three axes, whose cost lacks the square of `scale`; bin 0: that axis has none.
SahSplit choose_axis(Lanes lane_cost, Lanes lane_larger, Lanes lane_bin, float scale) {
  float cost[4], larger[4], bin[4];
  lanes_store(lane_cost, cost), lanes_store(lane_larger, larger), lanes_store(lane_bin, bin);
  SahSplit best;
  int chosen = -1;
  for (int axis = 0; axis < 3; ++axis) {
    if (bin[axis] == 0) continue;
    if (chosen >= 0 && !(cost[axis] < cost[chosen] || (cost[axis] == cost[chosen] && larger[axis] < larger[chosen]))) {
      continue;
    }
    chosen = axis;
  }
  if (chosen < 0) return best;
  best.axis = chosen;
  best.bin = static_cast<uint32_t>(bin[chosen]);
  best.cost = cost[chosen] / (static_cast<double>(scale) * scale);
  return best;
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

Binning::Side Binning::side_of(const SahSplit& split) const {
  Side side;
  side.origin_ = origin_, side.scale_ = scale_;
  side.border_ = lanes_set(static_cast<float>(split.bin));
  side.bit_ = 1 << split.axis;
  return side;
}

SahBins::SahBins(uint32_t bin_count) : bin_count_(bin_count) {
  for (uint32_t i = 0; i < bin_count; ++i) {
    const LaneBox empty;
    for (Box& box : box_[i]) box = {empty.lo, empty.hi};
    for (int32_t& count : count_[i]) count = 0;
  }
}

void SahBins::add(std::span<const BuildRef> refs, const Binning& binning) {
  // Bins of a few references first: were they found one by one, each box would wait for where the one before goes.
  constexpr size_t kAtOnce = 32;
  alignas(16) int32_t bin[kAtOnce][4];
  for (size_t first = 0; first < refs.size(); first += kAtOnce) {
    const size_t count = std::min(kAtOnce, refs.size() - first);
    for (size_t i = 0; i < count; ++i) binning.bins_of(refs[first + i], bin[i]);
    for (size_t i = 0; i < count; ++i) {
      const Lanes lo = lanes_load3(refs[first + i].lo), hi = lanes_load3(refs[first + i].hi);
      for (int axis = 0; axis < 3; ++axis) {
        const auto at = static_cast<uint32_t>(bin[i][axis]);
        Box& box = box_[at][axis];
        box.lo = lanes_min(lo, box.lo), box.hi = lanes_max(hi, box.hi);
        ++count_[at][axis];
      }
    }
  }
}

void SahBins::merge(const SahBins& other) {
  for (uint32_t i = 0; i < bin_count_; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      Box& box = box_[i][axis];
      box.lo = lanes_min(box.lo, other.box_[i][axis].lo), box.hi = lanes_max(box.hi, other.box_[i][axis].hi);
      count_[i][axis] += other.count_[i][axis];
    }
  }
}

// All axes at once, one a lane. Where one side is empty the cost is not a number (infinite area, no test): such planes
// lose every comparison.
SahSplit SahBins::best_split(const LaneBox& box, uint32_t block) const {
  const float scale = area_scale(box);
  const Lanes scales = lanes_set(scale);
  const int shift = std::countr_zero(block);
  const IntLanes round_up = int_lanes_set(static_cast<int32_t>(block - 1));
  const auto costs = [&](const LaneBox side[3], IntLanes count) {
    const IntLanes tests = int_lanes_shift_right(int_lanes_add(count, round_up), shift);
    return lanes_mul(scaled_areas(side, scales), lanes_convert(tests));
  };
  const auto include = [this](LaneBox side[3], uint32_t bin) {
    for (int axis = 0; axis < 3; ++axis) side[axis].include(LaneBox{box_[bin][axis].lo, box_[bin][axis].hi});
  };

  Lanes right_cost[kMaxBinCount], right_count[kMaxBinCount];
  LaneBox side[3];
  IntLanes count = int_lanes_set(0);
  for (uint32_t i = bin_count_ - 1; i > 0; --i) {
    include(side, i);
    count = int_lanes_add(count, int_lanes_load(count_[i]));
    right_cost[i] = costs(side, count);
    right_count[i] = lanes_convert(count);
  }
  for (LaneBox& b : side) b = {};
  count = int_lanes_set(0);
  Lanes best_cost = lanes_set(std::numeric_limits<float>::infinity()), best_larger = best_cost;
  Lanes best_bin = lanes_set(0.0f), bin = lanes_set(1.0f);
  for (uint32_t i = 1; i < bin_count_; ++i, bin = lanes_add(bin, lanes_set(1.0f))) {
    include(side, i - 1);
    count = int_lanes_add(count, int_lanes_load(count_[i - 1]));
    const Lanes cost = lanes_add(costs(side, count), right_cost[i]);
    const Lanes larger = lanes_max(lanes_convert(count), right_count[i]);
    const Lanes more_even = lanes_and(lanes_equal(cost, best_cost), lanes_less(larger, best_larger));
    const Lanes better = lanes_or(lanes_less(cost, best_cost), more_even);
    best_cost = lanes_select(better, cost, best_cost);
    best_larger = lanes_select(better, larger, best_larger);
    best_bin = lanes_select(better, bin, best_bin);
  }
  return choose_axis(best_cost, best_larger, best_bin, scale);
}

void SahBins::child_boxes(const SahSplit& split, LaneBox& left, LaneBox& right) const {
  for (uint32_t i = 0; i < bin_count_; ++i) {
    const Box& box = box_[i][split.axis];
    (i < split.bin ? left : right).include(LaneBox{box.lo, box.hi});
  }
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
