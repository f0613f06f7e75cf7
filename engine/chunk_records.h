// Triangles of an object in a scratch file, sorted into the chunks that it is built in: records of one size (corners,
// primitive, attributes of the corners), each chunk in a range of its own, in the order of the source.
// Called by engine/build_chunks. Thread rule: one thread at a time. Cost: a copy and a write a byte.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "engine/stream_object.h"
#include "io/aligned_buffer.h"
#include "io/scratch_file.h"
#include "treelets/triangle_soup.h"

namespace shoal {

inline uint64_t record_bytes(const CornerLayout& layout) { return 36 + 4 + 12ull * layout.floats(); }

/// The material of every triangle by its primitive id: all of a glTF primitive have one.
class MaterialLookup {
 public:
  MaterialLookup(const gltf::Document& document, const GeometryPlan& geometry, const MaterialPlan& materials,
                 const ObjectPlan& object);
  /// `hint` is kept between calls: ids that follow one another are found at once.
  uint32_t material_of(uint32_t primitive, size_t& hint) const;

 private:
  std::vector<std::pair<uint32_t, uint32_t>> firsts_;  // first id, material; ascending
};

/// Writes the record of one triangle to `out`, record_bytes(layout) long.
void encode_record(const TriangleSoup& soup, size_t triangle, std::byte* out);
/// Appends `count` records to the soup. Parallel inside.
void decode_records(std::span<const std::byte> records, const MaterialLookup& materials, TriangleSoup& soup);

/// Where each chunk lies in the scratch file.
struct ChunkExtent {
  uint64_t offset = 0, records = 0;
};

class ChunkWriter {
 public:
  /// Makes the file. `buffer_bytes`, a multiple of kBlockBytes, for each chunk. Fails with: kStorage, kMemoryCap.
  static Result<ChunkWriter> create(FileSystem& fs, const std::string& folder, std::span<const uint64_t> records,
                                    uint64_t bytes_a_record, uint64_t buffer_bytes);
  /// Fails with: kStorage; kInput when a chunk gets more records than it was made for.
  Status append(uint32_t chunk, const std::byte* record);
  /// Writes what is left in the buffers and frees them. Fails with: kInput when a chunk is not full, kStorage.
  Status finish();

  ScratchFile& file() { return *file_; }
  const std::vector<ChunkExtent>& extents() const { return extents_; }
  uint64_t record_size() const { return bytes_a_record_; }

 private:
  ChunkWriter() = default;
  Status flush(uint32_t chunk, uint64_t bytes);

  std::unique_ptr<ScratchFile> file_;
  std::vector<ChunkExtent> extents_;
  std::vector<uint64_t> appended_, flushed_bytes_, filled_bytes_;  // by chunk
  AlignedBuffer buffers_;
  std::byte* buffer_ = nullptr;
  uint64_t bytes_a_record_ = 0, buffer_bytes_ = 0;
};

}  // namespace shoal
