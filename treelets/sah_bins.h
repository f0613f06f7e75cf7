// Bins of the SAH build: where a reference falls, what each bin holds, and the cheapest plane between bins.
// Called by treelets/binned_sah and treelets/partition_refs, which must agree on where a reference falls to the
// bit. Plain values. Cost: about 5 ns a reference, 50 to 200 ns to find the split.
#pragma once

#include <cstdint>
#include <limits>
#include <span>

#include "treelets/binned_sah.h"
#include "treelets/lane_box.h"

namespace shoal {

inline constexpr uint32_t kMaxBinCount = 32;

/// A quarter of lo + hi: half the centroid, scaled so that no difference of two of them overflows.
inline Lanes binning_centroid(const BuildRef& ref) {
  const Lanes quarter = lanes_set(0.25f);
  return lanes_add(lanes_mul(lanes_load3(ref.lo), quarter), lanes_mul(lanes_load3(ref.hi), quarter));
}

/// A plane: references whose bin on `axis` is below `bin` go left.
struct SahSplit {
  double cost = std::numeric_limits<double>::infinity();
  int axis = -1;
  uint32_t bin = 0;

  bool found() const { return axis >= 0; }
};

/// Maps centroids to bins.
class Binning {
 public:
  Binning(const LaneBox& centroids, uint32_t ref_count);

  uint32_t bin_count() const { return bin_count_; }
  /// False when no axis can be divided: all centroids are equal (or closer than the smallest normal number).
  bool any_axis() const { return any_axis_; }
  void bins_of(const BuildRef& ref, int32_t bin[4]) const {
    const Lanes scaled = lanes_mul(lanes_sub(binning_centroid(ref), origin_), scale_);
    lanes_truncate(lanes_min(scaled, last_), bin);
  }
  /// Which side of a split references go to, without branches.
  class Side {
   public:
    /// Whether the reference with this binning_centroid() goes left: bins_of() truncates, and split.bin is whole.
    bool left(Lanes centroid) const { return (lanes_mask(lanes_less(position(centroid), border_)) & bit_) != 0; }

   private:
    friend class Binning;
    Lanes position(Lanes centroid) const { return lanes_mul(lanes_sub(centroid, origin_), scale_); }
    Lanes origin_, scale_, border_;
    int bit_;
  };
  Side side_of(const SahSplit& split) const;

 private:
  Lanes origin_, scale_, last_;
  uint32_t bin_count_;
  bool any_axis_ = false;
};

class SahBins {
 public:
  explicit SahBins(uint32_t bin_count);

  void add(std::span<const BuildRef> refs, const Binning& binning);
  void merge(const SahBins& other);
  /// The cheapest plane; among equal costs the most even, then the first. `box` is that of all references; requires:
  /// block is a power of two.
  SahSplit best_split(const LaneBox& box, uint32_t block) const;
  /// Boxes of the references on both sides.
  void child_boxes(const SahSplit& split, LaneBox& left, LaneBox& right) const;

 private:
  struct Box {  // as LaneBox, but not initialised before it is used: most nodes need few bins
    Lanes lo, hi;
  };
  Box box_[kMaxBinCount][3];                      // of each axis
  alignas(16) int32_t count_[kMaxBinCount][4];  // lanes are axes
  uint32_t bin_count_;
};

/// Bins all references, in parallel when there are many.
void fill_bins(std::span<const BuildRef> refs, const Binning& binning, SahBins& bins);

}  // namespace shoal
