#include "io/draco_mesh.h"

#include <draco/compression/decode.h>
#include <draco/compression/point_cloud/point_cloud_decoder.h>
#include <draco/core/varint_decoding.h>
#include <draco/metadata/metadata_decoder.h>
#include <fmt/format.h>

#include <cstring>
#include <new>

#include "io/gltf_json.h"

namespace shoal::gltf {

namespace {

/// Of an edgebreaker decoder, a triangle (faces, corner tables, traversal) and a vertex and attribute (the value, its
/// portable form, predictions and maps). Meshes with three attributes were seen to take 0.1 to 0.8 of it.
constexpr uint64_t kTriangleBytes = 160, kValueBytes = 44;

struct Sizes {
  uint64_t triangles = 0, vertices = 0;
};

/// What the stream's connectivity says of its size: Draco takes memory for it at once. Follows the bitstream
/// specification, version 2.2, sections "Draco decoder" and "Connectivity decoder".
std::optional<Sizes> peek_sizes(std::span<const std::byte> packed) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(packed.data()), packed.size());
  draco::DracoHeader header;
  if (!draco::PointCloudDecoder::DecodeHeader(&buffer, &header).ok()) return std::nullopt;
  if (header.encoder_type != draco::TRIANGULAR_MESH || header.version_major != 2 || header.version_minor != 2) {
    return std::nullopt;
  }
  buffer.set_bitstream_version(DRACO_BITSTREAM_VERSION(header.version_major, header.version_minor));
  if ((header.flags & METADATA_FLAG_MASK) != 0) {
    draco::GeometryMetadata metadata;
    if (!draco::MetadataDecoder().DecodeGeometryMetadata(&buffer, &metadata)) return std::nullopt;
  }
  uint32_t first = 0, second = 0;
  if (header.encoder_method == draco::MESH_SEQUENTIAL_ENCODING) {
    if (!draco::DecodeVarint(&first, &buffer) || !draco::DecodeVarint(&second, &buffer)) return std::nullopt;
    return Sizes{first, second};
  }
  uint8_t traversal = 0;
  if (!buffer.Decode(&traversal)) return std::nullopt;
  if (!draco::DecodeVarint(&first, &buffer) || !draco::DecodeVarint(&second, &buffer)) return std::nullopt;
  return Sizes{second, first};
}

template <class T>
bool convert(const draco::PointCloud& mesh, const draco::PointAttribute& attribute, std::byte* out) {
  T values[4];
  const auto components = static_cast<int8_t>(attribute.num_components());
  for (draco::PointIndex i(0); i < mesh.num_points(); ++i) {
    const draco::AttributeValueIndex value = attribute.mapped_index(i);
    if (value.value() >= attribute.size() || !attribute.ConvertValue<T>(value, components, values)) return false;
    std::memcpy(out, values, sizeof(T) * static_cast<size_t>(components));
    out += sizeof(T) * static_cast<size_t>(components);
  }
  return true;
}

bool convert(const draco::PointCloud& mesh, const draco::PointAttribute& attribute, ComponentType type,
             std::byte* out) {
  switch (type) {
    case ComponentType::kByte: return convert<int8_t>(mesh, attribute, out);
    case ComponentType::kUnsignedByte: return convert<uint8_t>(mesh, attribute, out);
    case ComponentType::kShort: return convert<int16_t>(mesh, attribute, out);
    case ComponentType::kUnsignedShort: return convert<uint16_t>(mesh, attribute, out);
    case ComponentType::kUnsignedInt: return convert<uint32_t>(mesh, attribute, out);
    case ComponentType::kFloat: return convert<float>(mesh, attribute, out);
  }
  return false;
}

}  // namespace

struct DracoMesh::State {
  std::unique_ptr<draco::Mesh> mesh;
  std::string place;
};

DracoMesh::DracoMesh(std::unique_ptr<State> state) : state_(std::move(state)) {}
DracoMesh::DracoMesh(DracoMesh&&) noexcept = default;
DracoMesh::~DracoMesh() = default;

Result<DracoMesh> DracoMesh::decode(std::span<const std::byte> packed, uint64_t triangles, uint64_t vertices,
                                    const std::string& place) {
  const auto wrong = [&](const std::string& found) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected a Draco mesh (bitstream 2.2) of {} triangles and {} "
                                                "vertices, found {}", place, triangles, vertices, found)};
  };
  try {
    const auto sizes = peek_sizes(packed);
    if (!sizes) return wrong("another format, or too few bytes");
    if (sizes->triangles != triangles || sizes->vertices > vertices) {
      return wrong(fmt::format("{} and {}", sizes->triangles, sizes->vertices));
    }
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(packed.data()), packed.size());
    draco::Decoder decoder;
    auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
    if (!decoded.ok()) return wrong(printable(decoded.status().error_msg_string()));
    auto state = std::make_unique<State>();
    state->mesh = std::move(decoded).value();
    state->place = place;
    if (state->mesh->num_faces() != triangles || state->mesh->num_points() != vertices) {
      return wrong(fmt::format("{} and {}", state->mesh->num_faces(), state->mesh->num_points()));
    }
    return DracoMesh(std::move(state));
  } catch (const std::bad_alloc&) {
    return Error{ErrorCode::kMemoryCap, fmt::format("{}: no memory to decode a Draco mesh", place)};
  } catch (const std::exception& error) {
    return wrong(printable(error.what()));
  }
}

void DracoMesh::read_indices(std::span<uint32_t> out) const {
  const draco::Mesh& mesh = *state_->mesh;
  SHOAL_CHECK(out.size() == 3ull * mesh.num_faces());
  uint32_t* target = out.data();
  for (draco::FaceIndex i(0); i < mesh.num_faces(); ++i) {
    for (const draco::PointIndex& corner : mesh.face(i)) *target++ = corner.value();
  }
}

Status DracoMesh::read_attribute(uint32_t id, const Accessor& accessor, std::span<std::byte> out) const {
  const draco::PointAttribute* const attribute = state_->mesh->GetAttributeByUniqueId(id);
  if (attribute == nullptr || attribute->num_components() != accessor.components || accessor.components > 4 ||
      accessor.matrix) {
    const std::string found = attribute == nullptr ? "none" : fmt::format("{}", attribute->num_components());
    return Error{ErrorCode::kInput, fmt::format("{}: expected an attribute {} of {} components, found {}", state_->place,
                                                id, accessor.components, found)};
  }
  const uint64_t element = uint64_t{accessor.components} * component_bytes(accessor.type);
  SHOAL_CHECK(out.size() == uint64_t{state_->mesh->num_points()} * element);
  if (convert(*state_->mesh, *attribute, accessor.type, out.data())) return {};
  return Error{ErrorCode::kInput, fmt::format("{}: attribute {}: expected values of component type {}, found others",
                                              state_->place, id, static_cast<int>(accessor.type))};
}

uint64_t DracoMesh::memory_bytes(uint64_t triangles, uint64_t vertices, uint64_t attributes) {
  return triangles * kTriangleBytes + vertices * attributes * kValueBytes;
}

}  // namespace shoal::gltf
