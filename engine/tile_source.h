// A glTF made ready for copying: its nodes flattened, its primitives gathered into groups that can become one
// primitive a copy (same material, same attributes), its bounds and triangles counted. Called by
// engine/generate_tile only. One thread. Memory: a few hundred bytes a primitive; vertices are streamed.
#pragma once

#include <functional>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <optional>
#include <string>
#include <vector>

#include "engine/gltf_writer.h"
#include "io/gltf_accessor.h"
#include "treelets/vector.h"

namespace shoal {

/// One appearance of a primitive in the source's scene.
struct SourceMember {
  const gltf::Primitive* primitive = nullptr;
  glm::dmat4 to_world{1};
  bool mirrored = false;  ///< to_world turns the winding round
  uint64_t vertices_count = 0;
};

/// Members that are written as one primitive.
struct SourceGroup {
  std::optional<uint32_t> material;
  std::vector<std::string> attributes;  ///< without POSITION
  std::vector<SourceMember> members;
  uint64_t vertices_count = 0, triangles_count = 0;
};

/// A light or a camera where it stands.
struct SourceFixture {
  gltf::Node node;  ///< camera or light set, matrix in world space
};

struct TileSource {
  gltf::Document document;
  std::vector<SourceGroup> groups;
  std::vector<SourceFixture> cameras, lights;
  uint64_t triangles_count = 0;
  glm::dvec3 lo{0}, hi{0};  ///< of all positions, world space
};

/// Fails with: what load_document returns; kInput when there are no triangles.
Result<TileSource> open_tile_source(FileSystem& fs, const std::string& path);

/// Calls take(values, first vertex) with chunks of a member's attribute as they are stored.
/// Fails with: kInput, kStorage.
Status read_attribute(gltf::BufferFiles& files, const gltf::Document& document, const SourceMember& member,
                      const std::string& name,
                      const std::function<void(std::span<float> values, uint32_t components)>& take);

/// Calls take(point) for every vertex of a member, in world space. Fails with: kInput (not finite), kStorage.
Status read_world_positions(gltf::BufferFiles& files, const gltf::Document& document, const SourceMember& member,
                            const std::function<void(const glm::dvec3&)>& take);

}  // namespace shoal
