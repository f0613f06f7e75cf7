// Where an object that does not fit in memory is cut: a binned-SAH split over the cells of a grid (the cost model of
// treelets/binned_sah.h), down to parts that fit. Neighbouring parts are read and built together as one chunk, as many
// as fit: so a chunk is never much smaller than it may be, and a treelet may hold pieces of two small parts.
// Called by engine/build_chunks. Pure. Cost: about 20 ns a cell and level.
#pragma once

#include <cstdint>
#include <vector>

#include "treelets/chunk_grid.h"
#include "treelets/graft_trees.h"

namespace shoal {

/// Parts [first, last) in depth-first order, built together.
struct Chunk {
  uint32_t first_part = 0, last_part = 0;
  uint64_t triangles_count = 0;
  /// One part of one cell, more than fits: to be cut again by a grid over that cell alone.
  bool too_large = false;
};

struct ChunkPlan {
  std::vector<PartNode> tree;             ///< over the parts; empty when there are no triangles
  std::vector<uint32_t> part_triangles;   ///< by part
  std::vector<uint32_t> part_of_cell;     ///< by cell of the grid; kNoIndex where nothing was counted
  std::vector<uint32_t> chunk_of_part;
  std::vector<Chunk> chunks;
};

/// Parts of at most `chunk_triangles`, but for single cells. Two neighbouring chunks together are larger than that, so
/// there are at most 2 n / chunk_triangles + 1. Depends on the counts only.
ChunkPlan split_chunks(const ChunkGrid& grid, uint64_t chunk_triangles);

}  // namespace shoal
