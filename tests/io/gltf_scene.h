// Small glTF scenes made by hand for the tests of the reader: JSON to be bent at will and one binary buffer.
#pragma once

#include <cstring>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "io/gltf_accessor.h"
#include "io/gltf_document.h"
#include "tests/support/memory_file_system.h"

namespace shoal::gltf {

constexpr int kByte = 5120, kUnsignedByte = 5121, kShort = 5122, kUnsignedShort = 5123, kUnsignedInt = 5125,
              kFloat = 5126;

struct GltfScene {
  GltfScene();

  nlohmann::json root;
  std::vector<std::byte> binary;

  /// Adds bytes to the buffer, and a view on them, aligned to 4.
  template <class T>
  uint32_t add_view(const std::vector<T>& values, uint32_t stride = 0) {
    return add_view_bytes(std::as_bytes(std::span(values)), stride);
  }
  uint32_t add_view_bytes(std::span<const std::byte> bytes, uint32_t stride);
  uint32_t add_accessor(const nlohmann::json& accessor);
  template <class T>
  uint32_t add_accessor(const std::vector<T>& values, const char* type, int component_type, uint64_t count) {
    return add_accessor(
        {{"bufferView", add_view(values)}, {"type", type}, {"componentType", component_type}, {"count", count}});
  }
  /// A mesh of one primitive, and a node that shows it.
  uint32_t add_mesh(const nlohmann::json& primitive);

  /// Puts scene.gltf and scene.bin there, or scene.glb. Returns the path.
  std::string put(MemoryFileSystem& fs) const;
  std::string put_glb(MemoryFileSystem& fs) const;
};

/// One triangle (0,0,0) (1,0,0) (0,1,0) with 16-bit indices, a normal, a material with a texture, a camera, a
/// light.
GltfScene triangle_scene();

/// Loads scene.gltf; the error's message when that fails.
std::string load_error(const GltfScene& scene, const Limits& limits = {});

/// All elements of an accessor, in one read.
std::vector<float> read_all(FileSystem& fs, const Document& document, uint32_t accessor);
/// All triangles of meshes[mesh].primitives[0], in one read.
std::vector<uint32_t> read_triangles(FileSystem& fs, const Document& document, uint32_t mesh = 0);

/// Reads every accessor, triangle and embedded image of a document; what fails is fine, what crashes is not.
void read_everything(FileSystem& fs, const Document& document);

}  // namespace shoal::gltf
