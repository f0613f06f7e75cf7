// Meshes compressed by the libraries' own encoders, for the tests of EXT_meshopt_compression and
// KHR_draco_mesh_compression.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace shoal::testing {

std::string pack_vertices(const void* values, size_t count, size_t stride);
std::string pack_triangles(const std::vector<uint32_t>& indices, size_t vertex_count);
std::string pack_sequence(const std::vector<uint32_t>& indices, size_t vertex_count);

struct DracoSource {
  std::vector<float> positions, normals, uvs;  ///< normals and uvs may be empty
  std::vector<uint32_t> indices;
  bool sequential = false;  ///< else edgebreaker
  int quantization_bits = 0;  ///< of positions; 0: exact
  /// Of attributes that no document speaks of: floats, all zero.
  std::vector<uint32_t> hidden_components = {};
};
struct PackedDraco {
  std::string bytes;
  uint32_t position_id = 0, normal_id = 0, uv_id = 0;
  /// What decoding gives, in the decoder's order.
  std::vector<float> positions, normals, uvs;
  std::vector<uint32_t> indices;
};
PackedDraco pack_draco(const DracoSource& source);

}  // namespace shoal::testing
