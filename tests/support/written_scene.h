// glTF scenes written by tests: meshes from plain arrays, everything else as JSON. Saved as scene.gltf + scene.bin.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/memory_file_system.h"

namespace shoal::testing {

class WrittenScene {
 public:
  WrittenScene();

  nlohmann::json json;

  uint32_t add_floats(uint32_t components, const std::vector<float>& values);
  uint32_t add_indices(const std::vector<uint32_t>& values);
  uint32_t add_bytes(uint32_t components, const std::vector<uint8_t>& values, bool normalized);
  /// A mesh of one primitive; returns its index.
  uint32_t add_mesh(const nlohmann::json& primitive);
  /// One unindexed triangle at (x, 0, 0), legs of `size`.
  uint32_t add_triangle_mesh(float x, float size);
  /// A root node of the scene; returns its index.
  uint32_t add_node(const nlohmann::json& node);
  /// An RGBA PNG named imageN.png, with a texture on it; returns the texture.
  uint32_t add_texture(MemoryFileSystem& fs, uint32_t width, uint32_t height, const std::vector<uint8_t>& rgba);
  void save(MemoryFileSystem& fs) const;

 private:
  uint32_t add_accessor(const void* bytes, size_t size, uint32_t component_type, uint32_t components, size_t count);
  std::string binary_;
};

/// An uncompressed RGBA PNG.
std::string png_bytes(uint32_t width, uint32_t height, const std::vector<uint8_t>& rgba);

}  // namespace shoal::testing
