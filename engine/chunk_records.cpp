#include "engine/chunk_records.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstring>

namespace shoal {

MaterialLookup::MaterialLookup(const gltf::Document& document, const GeometryPlan& geometry,
                               const MaterialPlan& materials, const ObjectPlan& object) {
  for (const uint32_t mesh : object.meshes) {
    for (const PrimitiveSource& source : geometry.meshes[mesh].primitives) {
      const gltf::Primitive& primitive = document.meshes[source.mesh].primitives[source.primitive];
      firsts_.emplace_back(source.first_id, materials.material_of(primitive));
    }
  }
  SHOAL_CHECK(!firsts_.empty() && std::is_sorted(firsts_.begin(), firsts_.end()));
}

uint32_t MaterialLookup::material_of(uint32_t primitive, size_t& hint) const {
  const auto holds = [&](size_t i) {
    return firsts_[i].first <= primitive && (i + 1 == firsts_.size() || primitive < firsts_[i + 1].first);
  };
  if (!holds(hint)) {
    const auto after = std::upper_bound(firsts_.begin(), firsts_.end(), std::pair(primitive, kNoIndex));
    hint = after == firsts_.begin() ? 0 : static_cast<size_t>(after - firsts_.begin()) - 1;
  }
  return firsts_[hint].second;
}

void encode_record(const TriangleSoup& soup, size_t triangle, std::byte* out) {
  std::memcpy(out, &soup.positions[9 * triangle], 36);
  std::memcpy(out + 36, &soup.primitive[triangle], 4);
  const size_t floats = 3 * size_t{soup.layout.floats()};
  if (floats > 0) std::memcpy(out + 40, &soup.corners[floats * triangle], floats * sizeof(float));
}

void decode_records(std::span<const std::byte> records, const MaterialLookup& materials, TriangleSoup& soup) {
  const size_t size = record_bytes(soup.layout), count = records.size() / size, first = soup.size();
  const size_t floats = 3 * size_t{soup.layout.floats()};
  soup.positions.resize(9 * (first + count));
  soup.primitive.resize(first + count);
  soup.material.resize(first + count);
  soup.corners.resize(floats * (first + count));
  tbb::parallel_for(tbb::blocked_range<size_t>(0, count, 1u << 14), [&](const tbb::blocked_range<size_t>& range) {
    size_t hint = 0;
    for (size_t i = range.begin(); i < range.end(); ++i) {
      const std::byte* record = &records[i * size];
      std::memcpy(&soup.positions[9 * (first + i)], record, 36);
      std::memcpy(&soup.primitive[first + i], record + 36, 4);
      soup.material[first + i] = materials.material_of(soup.primitive[first + i], hint);
      if (floats > 0) std::memcpy(&soup.corners[floats * (first + i)], record + 40, floats * sizeof(float));
    }
  });
}

Result<ChunkWriter> ChunkWriter::create(FileSystem& fs, const std::string& folder, std::span<const uint64_t> records,
                                        uint64_t bytes_a_record, uint64_t buffer_bytes) {
  SHOAL_CHECK(buffer_bytes > 0 && buffer_bytes % kBlockBytes == 0);
  ChunkWriter writer;
  writer.bytes_a_record_ = bytes_a_record;
  writer.buffer_bytes_ = buffer_bytes;
  uint64_t offset = 0;
  for (const uint64_t count : records) {
    writer.extents_.push_back({offset, count});
    offset += align_up(count * bytes_a_record, kBlockBytes);
  }
  writer.appended_.resize(records.size());
  writer.flushed_bytes_.resize(records.size());
  writer.filled_bytes_.resize(records.size());
  SHOAL_ASSIGN_OR_RETURN(writer.file_, ScratchFile::create(fs, folder, offset));
  SHOAL_ASSIGN_OR_RETURN(const auto buffers, writer.buffers_.reserve(buffer_bytes * records.size()));
  writer.buffer_ = buffers.data();
  return writer;
}

Status ChunkWriter::append(uint32_t chunk, const std::byte* record) {
  if (appended_[chunk]++ == extents_[chunk].records) {
    return Error{ErrorCode::kInput, "the source changed while it was read: more triangles than were counted"};
  }
  for (uint64_t left = bytes_a_record_; left > 0;) {
    const uint64_t n = std::min(left, buffer_bytes_ - filled_bytes_[chunk]);
    std::memcpy(buffer_ + chunk * buffer_bytes_ + filled_bytes_[chunk], record, n);
    filled_bytes_[chunk] += n, record += n, left -= n;
    if (filled_bytes_[chunk] == buffer_bytes_) SHOAL_RETURN_IF_ERROR(flush(chunk, buffer_bytes_));
  }
  return {};
}

Status ChunkWriter::flush(uint32_t chunk, uint64_t bytes) {
  const std::span<const std::byte> buffer(buffer_ + chunk * buffer_bytes_, bytes);
  SHOAL_RETURN_IF_ERROR(file_->write_at(extents_[chunk].offset + flushed_bytes_[chunk], buffer));
  flushed_bytes_[chunk] += bytes;
  filled_bytes_[chunk] = 0;
  return {};
}

Status ChunkWriter::finish() {
  for (uint32_t chunk = 0; chunk < extents_.size(); ++chunk) {
    if (appended_[chunk] != extents_[chunk].records) {
      return Error{ErrorCode::kInput, "the source changed while it was read: fewer triangles than were counted"};
    }
    const uint64_t filled = filled_bytes_[chunk], padded = align_up(filled, kBlockBytes);
    if (filled == 0) continue;
    std::memset(buffer_ + chunk * buffer_bytes_ + filled, 0, padded - filled);
    SHOAL_RETURN_IF_ERROR(flush(chunk, padded));
  }
  buffers_.shrink(0);
  return {};
}

}  // namespace shoal
