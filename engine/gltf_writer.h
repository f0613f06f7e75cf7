// Writes a glTF scene whose geometry streams: `<name>.gltf`, `<name>-000.bin`, `<name>-001.bin`, ... Called by
// engine/generate_*. One thread. Memory: one buffer, and the document's structs (a few hundred bytes a primitive).
//
//   writer.document()              materials, cameras, lights, meshes, nodes, textures: filled by the caller at any
//   time begin_accessor(kind, count)    then append_floats / append_indices until `count` elements are there
//   end_accessor()                 gives the accessor's index for a gltf::Primitive
//   finish()                       commits the parts, then the .gltf: before that nothing is visible
//
// Errors are sticky: the first is kept, later calls do nothing, status() and finish() return it.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/gltf_json_writer.h"
#include "io/file.h"
#include "io/gltf_document.h"

namespace shoal {

struct GltfWriterOptions {
  uint64_t part_bytes = 1ull << 30;    ///< of a .bin; an accessor that is larger has a part of its own
  uint64_t buffer_bytes = 1ull << 20;  ///< bytes held before they are written
};

enum class AccessorKind : uint8_t {
  kPosition,  ///< VEC3 float, with min and max
  kVec2,
  kVec3,
  kVec4,
  kIndex16,  ///< SCALAR unsigned short
  kIndex32,
};

class GltfWriter {
 public:
  /// `folder` must exist. Fails with: kStorage.
  static Result<std::unique_ptr<GltfWriter>> create(FileSystem& fs, const std::string& folder,
                                                    const std::string& name, const GltfWriterOptions& options = {});

  /// URIs (paths of images) are relative to the folder. Buffers, views and accessors belong to the writer.
  gltf::Document& document() { return document_; }

  /// Requires: no accessor is open, count > 0.
  void begin_accessor(AccessorKind kind, uint64_t count);
  /// Whole elements of a float kind. Requires: finite values.
  void append_floats(std::span<const float> values);
  /// Requires: an index kind that can hold the values.
  void append_indices(std::span<const uint32_t> values);
  /// Requires: exactly `count` elements were appended.
  uint32_t end_accessor();

  Status status() const;
  /// Bytes of all parts so far.
  uint64_t part_bytes() const { return total_bytes_; }
  /// The most bytes of geometry that were ever held in memory.
  uint64_t peak_buffered_bytes() const { return peak_buffered_bytes_; }
  /// Returns the bytes of the .gltf and its parts. Fails with: kStorage.
  Result<uint64_t> finish();
  std::string gltf_path() const;

 private:
  GltfWriter(FileSystem& fs, std::string folder, std::string name, const GltfWriterOptions& options);
  void open_part();
  void append_bytes(std::span<const std::byte> bytes);
  void flush();

  FileSystem* fs_;
  std::string folder_, name_;
  GltfWriterOptions options_;
  gltf::Document document_;
  std::vector<PositionBounds> bounds_;  ///< by accessor
  std::vector<AtomicFile> parts_;
  std::vector<std::byte> buffer_;
  Status status_;
  uint64_t part_used_bytes_ = 0, total_bytes_ = 0, peak_buffered_bytes_ = 0;
  AccessorKind kind_ = AccessorKind::kPosition;
  bool accessor_open_ = false;
  uint64_t elements_left_ = 0;
};

}  // namespace shoal
