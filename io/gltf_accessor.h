// Accessors as streams of floats or indices, read in bounded chunks from the file: a buffer is never held whole nor
// mapped. Handles every component type, stride, normalised integers, sparse values and missing views.
// Called by engine/build_scene. Thread rule: a BufferFiles and its readers belong to one thread; a document may be
// shared. Cost: one read of the blocks (kReadBytes) that a call wants and are not at hand, one conversion a value;
// at most kReaderBytes of memory a reader.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "io/aligned_buffer.h"
#include "io/gltf_document.h"

namespace shoal::gltf {

/// What a reader keeps of a buffer, at most.
inline constexpr uint64_t kReaderBytes = 1u << 20;
/// What is read at once: small enough that vertices in no order at all do not read a megabyte each.
inline constexpr uint64_t kReadBytes = 64u << 10;

/// Open files of a document's buffers, opened on first use, at most `max_open_files` at once. Read directly: the
/// system's cache counts against the memory of a control group.
class BufferFiles {
 public:
  static constexpr size_t kMaxOpenFiles = 128;
  BufferFiles(FileSystem& fs, const Document& document, size_t max_open_files = kMaxOpenFiles);
  /// Opens the buffer and checks that it is as long as byteLength says. Fails with: kInput.
  Status check(uint32_t buffer);
  /// Fills `out` from a buffer. Fails with: kInput (missing or shorter than byteLength says), kStorage.
  Status read(uint32_t buffer, uint64_t offset, std::span<std::byte> out);
  /// Bytes read so far.
  uint64_t read_bytes() const { return read_bytes_; }

 private:
  FileSystem* fs_;
  const Document* document_;
  size_t max_open_files_;
  Result<ReadableFile*> open(uint32_t buffer);
  std::vector<std::unique_ptr<ReadableFile>> files_;  // by buffer; null: not open
  std::vector<uint32_t> open_buffers_;                // oldest first
  uint64_t read_bytes_ = 0;
};

/// Random access over one accessor through a direct-mapped cache of blocks, together at most kReaderBytes: cheap
/// when the elements asked for lie within a megabyte, as they do in indexed meshes written by exporters; correct in
/// any order. Sparse values replace those of a block when it is loaded.
class AccessorReader {
 public:
  /// Checks the file's size and, with one pass over them, the sparse indices. Fails with: kInput, kStorage.
  static Result<AccessorReader> open(BufferFiles& files, const Document& document, uint32_t accessor);

  uint64_t count() const { return count_; }
  uint32_t components() const { return components_; }
  /// Elements [first, first + n) as floats (normalised integers scaled as in glTF 2.0 section 3.11), n *
  /// components(). Fails with: kInput (beyond count()), kStorage.
  Status read_floats(uint64_t first, uint64_t n, std::span<float> out);
  /// The same for unsigned integer scalars.
  Status read_indices(uint64_t first, uint64_t n, std::span<uint32_t> out);

 private:
  static constexpr uint64_t kNoBlock = ~0ull;
  static constexpr size_t kBlockCount = kReaderBytes / kReadBytes;

  AccessorReader() = default;
  uint64_t block_bytes() const { return block_elements_ * stride_; }
  /// The bytes of block `number`. What must be read for it is read together with the blocks up to `last` that follow
  /// and must be read too: large reads are what makes direct ones fast.
  Result<const std::byte*> load_blocks(uint64_t number, uint64_t last);
  Status check_sparse_indices();
  Status read_sparse_indices(uint64_t first, std::span<uint32_t> out);
  Status apply_sparse(uint64_t first, uint64_t n, std::span<std::byte> bytes);
  /// Calls convert(bytes of the first element, n) for each piece of [first, first + n) that lies in one block.
  template <class Convert>
  Status each_piece(uint64_t first, uint64_t n, Convert&& convert);
  Error error(const std::string& message) const;

  BufferFiles* files_ = nullptr;
  const Document* document_ = nullptr;
  uint32_t accessor_ = 0;
  uint64_t count_ = 0;
  uint32_t components_ = 0;
  uint64_t stride_ = 0, element_bytes_ = 0;
  uint64_t block_elements_ = 0;
  std::vector<uint64_t> numbers_;        // of the block in each slot, at most kBlockCount
  AlignedBuffer slots_;                  // taken on first use
  std::vector<uint32_t> sparse_firsts_;  // the first of every kSparseRun sparse indices
};

/// A run of triangles of a primitive: vertex indices, 3 a triangle, after strips and fans are undone.
/// Degenerate triangles of strips stay (they are counted and skipped by the builder).
class TriangleStream {
 public:
  /// Modes other than triangles, strips and fans, and primitives without POSITION, give count() == 0.
  /// Fails with: kInput, kStorage.
  static Result<TriangleStream> open(BufferFiles& files, const Document& document, const Primitive& primitive);
  /// The same by what the document says alone, also where bytes are still compressed: to be counted, not read.
  /// Fails with: kInput.
  static Result<TriangleStream> describe(const Document& document, const Primitive& primitive);
  uint64_t count() const { return count_; }
  uint64_t vertex_count() const { return vertex_count_; }
  /// Triangles [first, first + n) as 3n vertex indices. Fails with: kInput when an index is out of range.
  Status read(uint64_t first, uint64_t n, std::span<uint32_t> out);

 private:
  TriangleStream() = default;
  Status read_corners(uint64_t first, std::span<uint32_t> out);
  Status check_range(uint64_t first, std::span<const uint32_t> indices) const;
  std::optional<AccessorReader> indices_;
  PrimitiveMode mode_ = PrimitiveMode::kTriangles;
  uint64_t count_ = 0, vertex_count_ = 0;
  std::string place_;     // of messages
  uint32_t restart_ = 0;  // the largest value of the index type: primitive restart, which glTF forbids
};

}  // namespace shoal::gltf
