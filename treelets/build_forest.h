// Triangles to treelets, without the tree over them: the part of the builder that needs the triangles in memory. The
// triangles come in parts (cells of a larger object), each of which gets a binary tree of its own; treelets are cut and
// packed across neighbouring parts. An object that fits is one part.
// Called by treelets/build_object and engine/build_chunks. Parallel inside; the result depends on the input and the
// options only. Cost: as treelets/build_object; at most forest_bytes() at once.
#pragma once

#include <span>
#include <vector>

#include "io/result.h"
#include "treelets/build_object.h"
#include "treelets/graft_trees.h"

namespace shoal {

/// What a forest adds up to; sums over the forests of an object.
struct ForestSums {
  uint64_t triangles_count = 0, degenerate_count = 0, leaves_count = 0;
  double area = 0;  ///< half areas of nodes and leaves inside treelets
};

/// Builds the triangles of `soup` (consumed to bound memory). part_of[i], below part_count, is the part of triangle i;
/// empty: all are in part 0. Appends the tree of each part to `forest`, in order, and its entries to `entries`.
/// Requires: every part has a triangle that is stored, or there is one part (then nothing is appended).
/// Fails with: what the sink or the coverage source returns.
Status build_forest(TriangleSoup&& soup, std::vector<uint32_t>&& part_of, uint32_t part_count,
                    const BuildOptions& options, const CoverageSource* coverage, TreeletSink& sink,
                    UpperForest& forest, std::vector<TreeletEntry>& entries, ForestSums& sums);

/// Memory at once while `triangles` are built, soup and part_of included, pages in flight apart: an upper bound, which
/// triangles that share nothing and lie far apart come near.
uint64_t forest_bytes(uint64_t triangles, const CornerLayout& layout, BvhBuilder builder = BvhBuilder::kSah);
/// Memory of one page while it is packed. `on_grid`: positions are multiples of a TriangleSoup::position_step.
uint64_t page_in_flight_bytes(uint32_t treelet_bytes, const CornerLayout& layout, bool on_grid);

/// The object whose binary tree above its treelets is `upper`.
BuiltObject finish_object(std::span<const BinaryNode> upper, std::vector<TreeletEntry>&& entries,
                          const ForestSums& sums);

}  // namespace shoal
