#include "engine/build_chunks.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <future>

#include "engine/chunk_passes.h"
#include "engine/process_memory.h"
#include "treelets/build_forest.h"

namespace shoal {

namespace {

/// Each cut narrows a cell by several octaves; what is left after so many is divided by order instead.
constexpr uint32_t kMaxLevel = 6;

/// Appends to a soup whose size is known.
class GatherPass : public BlockTaker {
 public:
  GatherPass(TriangleSoup& soup, const ObjectBuildInput& input, ObjectBuildOutput& output)
      : soup_(soup), input_(input), output_(output) {}

  void prepare(StreamBlock& block) const override {
    block.corners = {};
    if (input_.positions != PositionPrecision::kExact) include_corners(block.triangles.soup.positions, block.corners);
  }
  Status take(StreamBlock& block) override {
    corners_.include(block.corners);
    const TriangleSoup& from = block.triangles.soup;
    soup_.positions.insert(soup_.positions.end(), from.positions.begin(), from.positions.end());
    soup_.primitive.insert(soup_.primitive.end(), from.primitive.begin(), from.primitive.end());
    soup_.material.insert(soup_.material.end(), from.material.begin(), from.material.end());
    soup_.corners.insert(soup_.corners.end(), from.corners.begin(), from.corners.end());
    output_.degenerate_count += block.triangles.degenerate_count;
    output_.zero_area_count += block.triangles.zero_area_count;
    for (Emitter& emitter : collect_emitters(from, input_.materials)) output_.emitters.push_back(emitter);
    input_.progress("reading", block.read_count);
    return {};
  }
  Status source_done(const PrimitiveSource& source) override {
    return input_.source_done ? input_.source_done(source) : Status();
  }
  /// Once all are there.
  void round() {
    const PositionGrid grid = output_.grid = PositionGrid::of(input_.positions, corners_);
    soup_.position_step = grid.step;
    if (grid.step == 0) return;
    const std::span<float> all = soup_.positions;
    tbb::parallel_for(tbb::blocked_range<size_t>(0, all.size(), 1u << 16),
                      [&](const auto& range) { grid.round(all.subspan(range.begin(), range.size())); });
    for (Emitter& emitter : output_.emitters) grid.round(emitter.position);
  }

 private:
  TriangleSoup& soup_;
  const ObjectBuildInput& input_;
  ObjectBuildOutput& output_;
  Bounds3 corners_;
};

/// Parts of `run` triangles in order, halved by count.
ChunkPlan split_by_order(uint64_t triangles, uint64_t run) {
  ChunkPlan plan;
  const auto parts = static_cast<uint32_t>((triangles + run - 1) / run);
  plan.tree.resize(1);
  const auto halve = [&](const auto& self, uint32_t node, uint32_t first, uint32_t last) -> void {
    if (last - first == 1) {
      plan.tree[node].part = first;
      return;
    }
    const auto child = static_cast<uint32_t>(plan.tree.size());
    plan.tree[node].left = child;
    plan.tree.resize(child + 2);
    self(self, child, first, first + (last - first) / 2);
    self(self, child + 1, first + (last - first) / 2, last);
  };
  halve(halve, 0, 0, parts);
  for (uint32_t part = 0; part < parts; ++part) {
    const uint64_t count = std::min(run, triangles - part * run);
    plan.part_triangles.push_back(static_cast<uint32_t>(count));
    plan.chunk_of_part.push_back(part);
    plan.chunks.push_back({part, part + 1, count, false});
  }
  plan.part_of_cell = {0};
  return plan;
}

class ChunkBuilder {
 public:
  ChunkBuilder(CornerLayout layout, const MaterialLookup& materials, const ObjectBuildInput& input,
               ObjectBuildOutput& output)
      : layout_(layout),
        materials_(materials),
        input_(input),
        output_(output),
        chunk_triangles_(input.memory.chunk_triangles(layout)) {}

  Status build(ObjectSource& source, uint64_t triangles) {
    SHOAL_ASSIGN_OR_RETURN(const std::vector<BinaryNode> tree, build_level(source, triangles, 0));
    sums_.degenerate_count += degenerate_count_;
    output_.object = finish_object(tree, std::move(entries_), sums_);
    return {};
  }

 private:
  /// One level of chunks; what comes back is the tree above all its treelets. `source`: RecordSource below level 0.
  template <class Source>
  Result<std::vector<BinaryNode>> build_level(Source& source, uint64_t triangles, uint32_t level) {
    const bool first = level == 0;
    const auto done = [&](const char* stage) {
      return TrianglesDone([this, first, stage](uint64_t n) { input_.progress(stage, first ? n : 0); });
    };
    const TrianglesDone measured = done("measuring"), counted = done("counting"), sorted = done("sorting");
    MeasurePass measure(first && input_.positions != PositionPrecision::kExact, measured);
    SHOAL_RETURN_IF_ERROR(source.stream(false, measure));
    if constexpr (std::is_same_v<Source, ObjectSource>) {
      output_.grid = PositionGrid::of(input_.positions, measure.corners());
      source.round_to(output_.grid);
    }
    ChunkGrid grid(measure.centroids(), input_.memory.grid_cells(triangles));
    CountPass count(grid, counted);
    SHOAL_RETURN_IF_ERROR(source.stream(false, count));
    const uint64_t stored = grid.triangles_count();
    const bool by_order = !grid.divides() || level >= kMaxLevel;
    const ChunkPlan plan = by_order && stored > chunk_triangles_ ? split_by_order(stored, chunk_triangles_)
                                                                 : split_chunks(grid, chunk_triangles_);
    grid.forget_counts();
    if (plan.chunks.empty()) return std::vector<BinaryNode>();

    const PartRouting routing{grid, plan, by_order && stored > chunk_triangles_ ? chunk_triangles_ : 0};
    std::vector<uint64_t> records;
    for (const Chunk& chunk : plan.chunks) records.push_back(chunk.triangles_count);
    SHOAL_ASSIGN_OR_RETURN(ChunkWriter writer,
                           ChunkWriter::create(input_.fs, input_.scratch_folder, records, record_bytes(layout_),
                                               input_.memory.write_buffer_bytes(records.size())));
    SortPass sort(routing, writer, input_.materials, first ? &output_.emitters : nullptr, sorted,
                  first ? &input_.source_done : nullptr);
    if constexpr (std::is_same_v<Source, RecordSource>) source.release_as_read();
    SHOAL_RETURN_IF_ERROR(source.stream(true, sort));
    SHOAL_RETURN_IF_ERROR(writer.finish());
    output_.degenerate_count += sort.unread_count();
    output_.zero_area_count += sort.zero_area_count();
    degenerate_count_ += sort.degenerate_count();
    give_back_freed_memory();
    return build_chunks(writer, routing, level);
  }

  Result<std::vector<BinaryNode>> build_chunks(ChunkWriter& writer, const PartRouting& routing, uint32_t level) {
    UpperForest forest;
    ScratchFile& file = writer.file();
    std::future<Status> reading;
    const auto read_ahead = [&](size_t chunk) {
      if (chunk >= routing.plan.chunks.size() || routing.plan.chunks[chunk].too_large) return;
      const ChunkExtent& extent = writer.extents()[chunk];
      reading = std::async(std::launch::async, [this, &file, &extent]() -> Status {
        SHOAL_ASSIGN_OR_RETURN(const auto bytes, raw_.reserve(chunk_bytes(extent)));
        return file.read_at(extent.offset, bytes);
      });
    };
    read_ahead(0);
    for (size_t c = 0; c < routing.plan.chunks.size(); ++c) {
      const Chunk& chunk = routing.plan.chunks[c];
      const ChunkExtent& extent = writer.extents()[c];
      if (chunk.too_large) {
        raw_.shrink(0);
        SHOAL_RETURN_IF_ERROR(build_large_chunk(file, extent, level, forest));
        read_ahead(c + 1);
      } else {
        SHOAL_RETURN_IF_ERROR(reading.get());
        TriangleSoup soup;
        SHOAL_ASSIGN_OR_RETURN(std::vector<uint32_t> part_of, load_chunk(extent, routing, chunk, soup));
        file.release(extent.offset, chunk_bytes(extent));
        read_ahead(c + 1);
        Status status = build_forest(std::move(soup), std::move(part_of), chunk.last_part - chunk.first_part,
                                     input_.treelets, &input_.coverage, input_.sink, forest, entries_, sums_);
        if (!status.ok()) {
          if (reading.valid()) reading.wait();
          return std::move(status).error();
        }
        ++output_.chunks_count;
        give_back_freed_memory();
        input_.progress("building", chunk.triangles_count);
      }
    }
    output_.scratch_written_bytes += file.written_bytes();
    output_.scratch_read_bytes += file.read_bytes();
    raw_.shrink(0);
    return graft_trees(routing.plan.tree, forest);
  }

  uint64_t chunk_bytes(const ChunkExtent& extent) const {
    return align_up(extent.records * record_bytes(layout_), kBlockBytes);
  }

  /// The chunk in raw_ as a soup, and the part of each triangle where it has several.
  Result<std::vector<uint32_t>> load_chunk(const ChunkExtent& extent, const PartRouting& routing, const Chunk& chunk,
                                           TriangleSoup& soup) {
    SHOAL_RETURN_IF_ERROR(check_stop(input_.stop, input_.path));
    SHOAL_ASSIGN_OR_RETURN(const auto bytes, raw_.reserve(chunk_bytes(extent)));
    soup.layout = layout_;
    soup.position_step = output_.grid.step;
    decode_records(bytes.first(extent.records * record_bytes(layout_)), materials_, soup);
    std::vector<uint32_t> part_of;
    const uint32_t parts = chunk.last_part - chunk.first_part;
    if (parts == 1) return part_of;
    part_of.resize(soup.size());
    std::vector<uint32_t> found(parts, 0);
    for (size_t i = 0; i < soup.size(); ++i) {
      const uint32_t cell = routing.grid.cell_of(&soup.positions[9 * i]);
      part_of[i] = routing.plan.part_of_cell[cell] - chunk.first_part;
      if (part_of[i] < parts) ++found[part_of[i]];
    }
    for (uint32_t p = 0; p < parts; ++p) {
      if (found[p] == routing.plan.part_triangles[chunk.first_part + p]) continue;
      return Error{ErrorCode::kInput, fmt::format("{}: the source changed while it was read", input_.path)};
    }
    return part_of;
  }

  Status build_large_chunk(ScratchFile& file, const ChunkExtent& extent, uint32_t level, UpperForest& forest) {
    RecordSource source(file, extent, layout_, materials_, input_.stop, input_.path);
    SHOAL_ASSIGN_OR_RETURN(const std::vector<BinaryNode> tree, build_level(source, extent.records, level + 1));
    SHOAL_CHECK(!tree.empty());
    const size_t place = forest.nodes.size();
    forest.roots.push_back(static_cast<uint32_t>(place));
    forest.nodes.resize(place + 1);
    copy_subtree(tree, 0, forest.nodes, place,
                 [&](uint32_t node) { return tree[node].leaf() ? tree[node].first : kNoIndex; });
    return {};
  }

  const CornerLayout layout_;
  const MaterialLookup& materials_;
  const ObjectBuildInput& input_;
  ObjectBuildOutput& output_;
  const uint64_t chunk_triangles_;
  AlignedBuffer raw_;  // the records of the next chunk
  std::vector<TreeletEntry> entries_;
  ForestSums sums_;
  uint64_t degenerate_count_ = 0;
};

}  // namespace

Result<ObjectBuildOutput> build_at_once(ObjectSource& source, uint64_t triangles, const ObjectBuildInput& input) {
  ObjectBuildOutput output;
  TriangleSoup soup;
  soup.layout = source.layout();
  soup.positions.reserve(9 * triangles);
  soup.primitive.reserve(triangles);
  soup.material.reserve(triangles);
  soup.corners.reserve(3 * triangles * soup.layout.floats());
  GatherPass gather(soup, input, output);
  SHOAL_RETURN_IF_ERROR(source.stream(true, gather));
  SHOAL_RETURN_IF_ERROR(check_stop(input.stop, input.path));
  gather.round();
  if (soup.size() > 0) {
    SHOAL_ASSIGN_OR_RETURN(output.object, build_object(std::move(soup), input.treelets, &input.coverage, input.sink));
  }
  input.progress("building", triangles);
  return output;
}

Result<ObjectBuildOutput> build_in_chunks(ObjectSource& source, uint64_t triangles, const MaterialLookup& materials,
                                          const ObjectBuildInput& input) {
  ObjectBuildOutput output;
  SHOAL_RETURN_IF_ERROR(ChunkBuilder(source.layout(), materials, input, output).build(source, triangles));
  return output;
}

}  // namespace shoal
