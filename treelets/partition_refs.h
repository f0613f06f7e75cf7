// Reorders references of a range around a split, in place. Called by treelets/binned_sah.
// Parallel inside for long ranges; the order that comes out depends on the input only (chunks have a fixed size).
// Cost: one pass over the references.
#pragma once

#include <span>

#include "treelets/sah_bins.h"

namespace shoal {

/// Moves what goes left to the front and returns its count; measures the centroids of both sides.
size_t partition_refs(std::span<BuildRef> refs, const Binning& binning, const SahSplit& split,
                      LaneBox& left_centroids, LaneBox& right_centroids);

/// Boxes of the references and of their centroids.
void measure_refs(std::span<const BuildRef> refs, LaneBox& box, LaneBox& centroids);

/// Moves the `left_count` references with the smallest centroids along the widest axis to the front.
void order_by_centroid(std::span<BuildRef> refs, size_t left_count, const LaneBox& centroids);

}  // namespace shoal
