#include "engine/tile_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/matrix.hpp>
#include <limits>
#include <map>
#include <tuple>

#include "io/decompress_document.h"

namespace shoal {
namespace {

constexpr uint64_t kChunkVertices = 8192;
constexpr uint64_t kMaxGroupVertices = 1u << 22;  // 48 MiB of positions: far below a part

glm::dmat4 matrix_of(const gltf::Node& node) {
  glm::dmat4 matrix;
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) matrix[column][row] = node.matrix[static_cast<size_t>(column * 4 + row)];
  }
  return matrix;
}

std::array<double, 16> array_of(const glm::dmat4& matrix) {
  std::array<double, 16> values;
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) values[static_cast<size_t>(column * 4 + row)] = matrix[column][row];
  }
  return values;
}

bool is_kept(const std::string& name) {
  return name == "NORMAL" || name == "TANGENT" || name == "COLOR_0" || name.starts_with("TEXCOORD_");
}

/// Attributes that are kept, with their widths: a colour may have three components or four.
std::vector<std::string> kept_attributes(const gltf::Document& document, const gltf::Primitive& primitive,
                                         std::string& signature) {
  std::vector<std::string> names;
  for (const auto& [name, accessor] : primitive.attributes) {
    if (!is_kept(name)) continue;
    names.push_back(name);
    signature += fmt::format("{}:{} ", name, document.accessors[accessor].components);
  }
  return names;
}

class Flattener {
 public:
  Flattener(FileSystem& fs, TileSource& source) : source_(&source), files_(fs, source.document) {}

  /// Recursion is bounded: the document's node depth is.
  Status visit(uint32_t index, const glm::dmat4& parent) {
    const gltf::Node& node = source_->document.nodes[index];
    const glm::dmat4 to_world = parent * matrix_of(node);
    if (node.mesh) {
      for (const gltf::Primitive& primitive : source_->document.meshes[*node.mesh].primitives) {
        SHOAL_RETURN_IF_ERROR(add(primitive, to_world));
      }
    }
    gltf::Node fixture;
    fixture.name = node.name;
    fixture.matrix = array_of(to_world);
    fixture.camera = node.camera;
    if (node.camera) source_->cameras.push_back({fixture});
    fixture.camera.reset();
    fixture.light = node.light;
    if (node.light) source_->lights.push_back({fixture});
    for (const uint32_t child : node.children) SHOAL_RETURN_IF_ERROR(visit(child, to_world));
    return {};
  }

  Status measure() {
    source_->lo = glm::dvec3(std::numeric_limits<double>::max());
    source_->hi = -source_->lo;
    for (const SourceGroup& group : source_->groups) {
      for (const SourceMember& member : group.members) {
        SHOAL_RETURN_IF_ERROR(read_world_positions(files_, source_->document, member, [&](const glm::dvec3& point) {
          source_->lo = glm::min(source_->lo, point);
          source_->hi = glm::max(source_->hi, point);
        }));
      }
    }
    return {};
  }

 private:
  Status add(const gltf::Primitive& primitive, const glm::dmat4& to_world) {
    SHOAL_ASSIGN_OR_RETURN(const gltf::TriangleStream triangles,
                           gltf::TriangleStream::open(files_, source_->document, primitive));
    if (triangles.count() == 0 || triangles.vertex_count() == 0) return {};
    SourceMember member;
    member.primitive = &primitive;
    member.to_world = to_world;
    member.mirrored = glm::determinant(glm::dmat3(to_world)) < 0;
    member.vertices_count = triangles.vertex_count();

    std::string signature;
    std::vector<std::string> names = kept_attributes(source_->document, primitive, signature);
    const auto key = std::make_tuple(primitive.material.value_or(~0u), signature);
    const auto open = open_groups_.find(key);
    const bool fits = open != open_groups_.end() &&
                      source_->groups[open->second].vertices_count + member.vertices_count <= kMaxGroupVertices;
    if (!fits) {
      open_groups_[key] = source_->groups.size();
      source_->groups.push_back({primitive.material, std::move(names), {}, 0, 0});
    }
    SourceGroup& group = source_->groups[open_groups_[key]];
    group.members.push_back(member);
    group.vertices_count += member.vertices_count;
    group.triangles_count += triangles.count();
    source_->triangles_count += triangles.count();
    return {};
  }

  TileSource* source_;
  gltf::BufferFiles files_;
  std::map<std::tuple<uint32_t, std::string>, size_t> open_groups_;
};

}  // namespace

Result<TileSource> open_tile_source(FileSystem& fs, const std::string& path) {
  TileSource source;
  SHOAL_ASSIGN_OR_RETURN(source.document, gltf::load_document(fs, path));
  if (gltf::compression_needs(source.document).memory_bytes > 0) {
    return Error{ErrorCode::kUnsupported, fmt::format("{}: its geometry is compressed, which is not copied; decompress it "
                                                      "first, for example with `gltf-transform copy IN OUT`", path)};
  }
  Flattener flattener(fs, source);
  for (const uint32_t root : source.document.roots) SHOAL_RETURN_IF_ERROR(flattener.visit(root, glm::dmat4(1)));
  if (source.triangles_count == 0) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected triangles to copy, found none", path)};
  }
  SHOAL_RETURN_IF_ERROR(flattener.measure());
  return source;
}

Status read_attribute(gltf::BufferFiles& files, const gltf::Document& document, const SourceMember& member,
                      const std::string& name,
                      const std::function<void(std::span<float> values, uint32_t components)>& take) {
  const uint32_t accessor = member.primitive->attributes.at(name);
  SHOAL_ASSIGN_OR_RETURN(gltf::AccessorReader reader, gltf::AccessorReader::open(files, document, accessor));
  std::vector<float> values;
  for (uint64_t first = 0; first < member.vertices_count; first += kChunkVertices) {
    const uint64_t n = std::min(kChunkVertices, member.vertices_count - first);
    values.resize(n * reader.components());
    SHOAL_RETURN_IF_ERROR(reader.read_floats(first, n, values));
    for (const float value : values) {
      if (std::isfinite(value)) continue;
      return Error{ErrorCode::kInput, fmt::format("{}: accessors[{}]: expected finite values to copy, found {}",
                                                  document.path, accessor, value)};
    }
    take(values, reader.components());
  }
  return {};
}

Status read_world_positions(gltf::BufferFiles& files, const gltf::Document& document, const SourceMember& member,
                            const std::function<void(const glm::dvec3&)>& take) {
  constexpr double kLargest = 1e30;  // leaves room for copies beside one another in float
  bool in_range = true;
  SHOAL_RETURN_IF_ERROR(
      read_attribute(files, document, member, "POSITION", [&](std::span<float> values, uint32_t components) {
        for (size_t i = 0; i + 2 < values.size(); i += components) {
          const glm::dvec3 point(member.to_world * glm::dvec4(values[i], values[i + 1], values[i + 2], 1));
          const glm::dvec3 size = glm::abs(point);
          in_range = in_range && size.x < kLargest && size.y < kLargest && size.z < kLargest;
          take(point);
        }
      }));
  if (in_range) return {};
  return Error{ErrorCode::kInput,
               fmt::format("{}: a vertex lies beyond {} in world space", document.path, kLargest)};
}

}  // namespace shoal
