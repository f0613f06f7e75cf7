// Accessors as streams of floats or indices, read in bounded chunks from the file: a buffer is never held whole nor
// mapped. Handles every component type, stride, normalised integers, sparse values and missing views.
// Called by engine/build_scene. One reader a thread. Cost: one pread a chunk (kChunkBytes), one conversion a value.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "io/gltf_document.h"

namespace shoal::gltf {

inline constexpr uint64_t kChunkBytes = 1u << 20;

/// Open files of a document's buffers, opened on first use.
class BufferFiles {
 public:
  BufferFiles(FileSystem& fs, const Document& document);
  /// Fills `out` from a buffer. Fails with: kInput (missing or shorter than byteLength says), kStorage.
  Status read(uint32_t buffer, uint64_t offset, std::span<std::byte> out);
  /// Bytes read so far.
  uint64_t read_bytes() const { return read_bytes_; }

 private:
  FileSystem* fs_;
  const Document* document_;
  std::vector<std::unique_ptr<ReadableFile>> files_;
  uint64_t read_bytes_ = 0;
};

/// Random access over one accessor through a sliding window of at most kChunkBytes: cheap when the
/// elements asked for lie close together, as they do in indexed meshes written by exporters; correct in any order.
class AccessorReader {
 public:
  static Result<AccessorReader> open(BufferFiles& files, const Document& document, uint32_t accessor);

  uint64_t count() const { return count_; }
  uint32_t components() const { return components_; }
  /// Elements [first, first + n) as floats (normalised integers scaled as in glTF 2.0 section 3.11), n * components().
  Status read_floats(uint64_t first, uint64_t n, std::span<float> out);
  /// The same for unsigned integer scalars.
  Status read_indices(uint64_t first, uint64_t n, std::span<uint32_t> out);

 private:
  AccessorReader() = default;
  Status load_window(uint64_t first, uint64_t n);
  BufferFiles* files_ = nullptr;
  const Document* document_ = nullptr;
  uint32_t accessor_ = 0;
  uint64_t count_ = 0;
  uint32_t components_ = 0;
  uint64_t window_first_ = 0, window_count_ = 0;
  std::vector<std::byte> window_;
  std::vector<uint32_t> sparse_indices_;   // sorted, in chunks bounded by Limits
  std::vector<float> sparse_values_;
};

/// A run of triangles of a primitive: vertex indices, 3 a triangle, after strips and fans are undone.
/// Degenerate triangles of strips stay (they are counted and skipped by the builder).
class TriangleStream {
 public:
  /// Modes other than triangles, strips and fans give count() == 0.
  static Result<TriangleStream> open(BufferFiles& files, const Document& document, const Primitive& primitive);
  uint64_t count() const { return count_; }
  uint64_t vertex_count() const { return vertex_count_; }
  /// Triangles [first, first + n) as 3n vertex indices. Fails with: kInput when an index is out of range.
  Status read(uint64_t first, uint64_t n, std::span<uint32_t> out);

 private:
  TriangleStream() = default;
  std::optional<AccessorReader> indices_;
  PrimitiveMode mode_ = PrimitiveMode::kTriangles;
  uint64_t count_ = 0, vertex_count_ = 0;
  std::string place_;
};

}  // namespace shoal::gltf
