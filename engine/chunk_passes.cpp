#include "engine/chunk_passes.h"

#include <fmt/format.h>

#include "treelets/triangle_refs.h"

namespace shoal {

namespace {

constexpr uint32_t kNotStored = kNoIndex;

Error source_changed(const char* what) {
  return {ErrorCode::kInput, fmt::format("the source changed while it was read: {}", what)};
}

}  // namespace

void MeasurePass::prepare(StreamBlock& block) const {
  const std::vector<float>& positions = block.triangles.soup.positions;
  block.centroids = {};
  for (size_t i = 0; i < positions.size(); i += 9) {
    if (!is_degenerate(&positions[i])) block.centroids.include(chunk_centroid(&positions[i]));
  }
  block.corners = {};
  if (corners_too_) include_corners(positions, block.corners);
}

Status MeasurePass::take(StreamBlock& block) {
  centroids_.include(block.centroids);
  corners_.include(block.corners);
  done_(block.read_count);
  return {};
}

void CountPass::prepare(StreamBlock& block) const {
  const std::vector<float>& positions = block.triangles.soup.positions;
  block.tags.resize(positions.size() / 9);
  for (size_t i = 0; i < block.tags.size(); ++i) {
    const float* p = &positions[9 * i];
    block.tags[i] = is_degenerate(p) ? kNotStored : grid_.cell_of(p);
  }
}

Status CountPass::take(StreamBlock& block) {
  for (size_t i = 0; i < block.tags.size(); ++i) {
    if (block.tags[i] != kNotStored) grid_.add(block.tags[i], &block.triangles.soup.positions[9 * i]);
  }
  done_(block.read_count);
  return {};
}

void SortPass::prepare(StreamBlock& block) const {
  const TriangleSoup& soup = block.triangles.soup;
  const uint64_t size = writer_.record_size();
  block.tags.resize(soup.size());
  block.records.resize(soup.size() * size);
  for (size_t i = 0; i < soup.size(); ++i) {
    const float* p = &soup.positions[9 * i];
    block.tags[i] = is_degenerate(p) ? kNotStored : routing_.grid.cell_of(p);
    encode_record(soup, i, &block.records[i * size]);
  }
}

Status SortPass::take(StreamBlock& block) {
  const TriangleSoup& soup = block.triangles.soup;
  unread_count_ += block.triangles.degenerate_count;
  zero_area_count_ += block.triangles.zero_area_count;
  if (emitters_ != nullptr) {  // a block has one material
    for (Emitter& emitter : collect_emitters(soup, materials_)) emitters_->push_back(emitter);
  }
  for (size_t i = 0; i < block.tags.size(); ++i) {
    if (block.tags[i] == kNotStored) {
      ++degenerate_count_;
      continue;
    }
    const uint32_t part = routing_.run_triangles > 0 ? static_cast<uint32_t>(stored_count_ / routing_.run_triangles)
                                                     : routing_.plan.part_of_cell[block.tags[i]];
    ++stored_count_;
    if (part >= routing_.plan.chunk_of_part.size()) return source_changed("a triangle where none was");
    SHOAL_RETURN_IF_ERROR(
        writer_.append(routing_.plan.chunk_of_part[part], &block.records[i * writer_.record_size()]));
  }
  done_(block.read_count);
  return {};
}

Status SortPass::source_done(const PrimitiveSource& source) {
  return source_done_ != nullptr && *source_done_ ? (*source_done_)(source) : Status();
}

Status RecordSource::stream(bool with_corners, BlockTaker& taker) {
  (void)with_corners;  // they lie beside the positions anyway
  const uint64_t size = record_bytes(layout_);
  StreamBlock block;
  AlignedBuffer buffer;
  for (uint64_t first = 0; first < extent_.records; first += kBlockTriangles) {
    SHOAL_RETURN_IF_ERROR(check_stop(stop_, path_));
    const uint64_t n = std::min(kBlockTriangles, extent_.records - first);
    const uint64_t offset = extent_.offset + first * size, begin = align_down(offset, kBlockBytes);
    const uint64_t end = align_up(offset + n * size, kBlockBytes);
    SHOAL_ASSIGN_OR_RETURN(const auto bytes, buffer.reserve(end - begin));
    SHOAL_RETURN_IF_ERROR(file_.read_at(begin, bytes));
    block.triangles.clear(layout_, n);
    block.read_count = n;
    decode_records(bytes.subspan(offset - begin, n * size), materials_, block.triangles.soup);
    taker.prepare(block);
    SHOAL_RETURN_IF_ERROR(taker.take(block));
    if (release_) file_.release(begin, align_down(offset + n * size, kBlockBytes) - begin);
  }
  return {};
}

}  // namespace shoal
