// The passes over the triangles of an object that is built in chunks, each a BlockTaker. Called by engine/build_chunks.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "engine/chunk_records.h"
#include "engine/emitters.h"
#include "engine/stream_object.h"
#include "treelets/chunk_grid.h"
#include "treelets/split_chunks.h"

namespace shoal {

using TrianglesDone = std::function<void(uint64_t)>;

/// First: where the centroids lie, and, for a grid to round to, the corners.
class MeasurePass : public BlockTaker {
 public:
  MeasurePass(bool corners_too, const TrianglesDone& done) : corners_too_(corners_too), done_(done) {}
  void prepare(StreamBlock& block) const override;
  Status take(StreamBlock& block) override;
  const Bounds3& centroids() const { return centroids_; }
  const Bounds3& corners() const { return corners_; }

 private:
  const bool corners_too_;
  const TrianglesDone& done_;
  Bounds3 centroids_, corners_;
};

/// Second: how many lie in each cell.
class CountPass : public BlockTaker {
 public:
  CountPass(ChunkGrid& grid, const TrianglesDone& done) : grid_(grid), done_(done) {}
  void prepare(StreamBlock& block) const override;
  Status take(StreamBlock& block) override;

 private:
  ChunkGrid& grid_;
  const TrianglesDone& done_;
};

/// Which part a triangle goes to: by its cell, or, where no grid can tell them apart, by its place in the order.
struct PartRouting {
  const ChunkGrid& grid;
  const ChunkPlan& plan;
  uint64_t run_triangles = 0;  ///< of each part, by order; 0: by cell
};

/// Third: each triangle to the chunk of its part; emitters are collected on the way, in the order of the source.
class SortPass : public BlockTaker {
 public:
  /// `emitters` may be null: they were collected before.
  SortPass(const PartRouting& routing, ChunkWriter& writer, const std::vector<Material>& materials,
           std::vector<Emitter>* emitters, const TrianglesDone& done,
           const std::function<Status(const PrimitiveSource&)>* source_done)
      : routing_(routing),
        writer_(writer),
        materials_(materials),
        emitters_(emitters),
        done_(done),
        source_done_(source_done) {}
  void prepare(StreamBlock& block) const override;
  Status take(StreamBlock& block) override;
  Status source_done(const PrimitiveSource& source) override;
  /// Left out by the reader, and by the builder's own test.
  uint64_t unread_count() const { return unread_count_; }
  uint64_t degenerate_count() const { return degenerate_count_; }
  /// Among those that are stored; 0 where they were read before.
  uint64_t zero_area_count() const { return zero_area_count_; }

 private:
  const PartRouting& routing_;
  ChunkWriter& writer_;
  const std::vector<Material>& materials_;
  std::vector<Emitter>* emitters_;
  const TrianglesDone& done_;
  const std::function<Status(const PrimitiveSource&)>* source_done_;
  uint64_t unread_count_ = 0, degenerate_count_ = 0, zero_area_count_ = 0, stored_count_ = 0;
};

/// The records of a chunk as a source: one that has to be cut again.
class RecordSource : public TriangleSource {
 public:
  RecordSource(ScratchFile& file, const ChunkExtent& extent, CornerLayout layout, const MaterialLookup& materials,
               const std::atomic<bool>* stop, const std::string& path)
      : file_(file), extent_(extent), layout_(layout), materials_(materials), stop_(stop), path_(path) {}
  Status stream(bool with_corners, BlockTaker& taker) override;
  /// From now on what was read is given back: the next stream() is the last.
  void release_as_read() { release_ = true; }

 private:
  ScratchFile& file_;
  const ChunkExtent extent_;
  const CornerLayout layout_;
  const MaterialLookup& materials_;
  const std::atomic<bool>* stop_;
  const std::string& path_;
  bool release_ = false;
};

}  // namespace shoal
