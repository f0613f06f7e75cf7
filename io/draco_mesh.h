// A mesh of KHR_draco_mesh_compression, decoded whole, for io/decompress_document; Draco stays inside the .cpp. Thread
// rule: one thread. Memory: at most memory_bytes(), whatever attributes a stream has: what it says of its triangles,
// vertices and attributes is read, and refused, before memory is taken for them. Not bounded by it is what Draco takes of
// itself for a stream's descriptions and tables of symbols before it sees that they are wrong: up to 512 bytes a
// compressed byte.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "io/gltf_document.h"

namespace shoal::gltf {

class DracoMesh {
 public:
  /// Refuses, before it is decoded, what does not have `triangles` triangles and `vertices` vertices, and attributes that
  /// take more than `attributes` of four components would, so that no stream takes more than its document says. `place`
  /// is for messages. Fails with: kInput, kMemoryCap.
  static Result<DracoMesh> decode(std::span<const std::byte> packed, uint64_t triangles, uint64_t vertices,
                                  uint64_t attributes, const std::string& place);
  DracoMesh(DracoMesh&&) noexcept;
  ~DracoMesh();

  /// 3 a triangle.
  void read_indices(std::span<uint32_t> out) const;
  /// The attribute of this unique id, `vertices` elements of `accessor`'s components and type, one behind the other.
  /// Fails with: kInput (no such attribute, of other components or a value beyond the type).
  Status read_attribute(uint32_t id, const Accessor& accessor, std::span<std::byte> out) const;

  /// What decoding takes at most, beside the compressed bytes.
  static uint64_t memory_bytes(uint64_t triangles, uint64_t vertices, uint64_t attributes);

 private:
  struct State;
  explicit DracoMesh(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace shoal::gltf
