#include "io/draco_mesh.h"

#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/core/varint_decoding.h>
#include <draco/metadata/metadata_decoder.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <new>

#include "io/gltf_json.h"

namespace shoal::gltf {

namespace {

/// Of an edgebreaker decoder, a triangle (faces, corner tables, traversal) and a vertex and attribute: the value and its
/// portable form of four bytes, of each component, and maps. Meshes with three attributes were seen to take 0.1 to 0.8
/// of it.
constexpr uint64_t kTriangleBytes = 160, kPortableBytes = 4, kMapBytes = 12;
constexpr uint64_t kValueBytes = 4 * (sizeof(float) + kPortableBytes) + kMapBytes;
static_assert(kValueBytes == 44);

struct Sizes {
  uint64_t triangles = 0, vertices = 0;
  uint64_t seam_tables = 0;  ///< corner tables of attributes with seams of their own: edgebreaker only
  bool sequential = false;
};

/// What the stream's connectivity says of its size: Draco takes memory for it at once. Follows the bitstream
/// specification, version 2.2, sections "Draco decoder", "Sequential" and "EdgeBreaker connectivity decoder".
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
    return Sizes{first, second, 0, true};
  }
  uint8_t traversal = 0, seam_tables = 0;
  if (!buffer.Decode(&traversal)) return std::nullopt;
  if (!draco::DecodeVarint(&first, &buffer) || !draco::DecodeVarint(&second, &buffer)) return std::nullopt;
  if (!buffer.Decode(&seam_tables)) return std::nullopt;
  return Sizes{second, first, seam_tables, false};
}

/// One of Draco's decoders, stopped where vertices are counted and attributes described, but none has memory yet.
template <class Method>
class BoundedDecoder final : public Method {
 public:
  BoundedDecoder(uint64_t vertices, uint64_t attributes) : vertices_(vertices), attributes_(attributes) {}
  /// What was found instead; empty if that was not the matter.
  const std::string& refused() const { return refused_; }

 private:
  bool DecodeAllAttributes() override {
    const draco::PointCloud& cloud = *this->point_cloud();
    uint64_t bytes = 0;
    for (int32_t i = 0; i < cloud.num_attributes(); ++i) {
      const draco::PointAttribute& attribute = *cloud.attribute(i);
      const auto length = static_cast<uint64_t>(std::max(0, draco::DataTypeLength(attribute.data_type())));
      bytes += static_cast<uint8_t>(attribute.num_components()) * (length + kPortableBytes) + kMapBytes;
    }
    if (cloud.num_points() != vertices_) {
      refused_ = fmt::format("{} vertices", cloud.num_points());
    } else if (bytes > attributes_ * kValueBytes) {
      refused_ = fmt::format("{} attributes that take {} bytes a vertex", cloud.num_attributes(), bytes);
    }
    return refused_.empty() && Method::DecodeAllAttributes();
  }

  uint64_t vertices_, attributes_;
  std::string refused_;
};

/// The message of what is wrong; empty if nothing is.
template <class Method>
std::string decode_bounded(std::span<const std::byte> packed, uint64_t vertices, uint64_t attributes,
                           draco::Mesh& mesh) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(packed.data()), packed.size());
  BoundedDecoder<Method> decoder(vertices, attributes);
  const draco::Status status = decoder.Decode(draco::DecoderOptions(), &buffer, &mesh);
  if (status.ok()) return {};
  return decoder.refused().empty() ? printable(status.error_msg_string()) : decoder.refused();
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
                                    uint64_t attributes, const std::string& place) {
  const auto wrong = [&](const std::string& found) {
    return Error{ErrorCode::kInput,
                 fmt::format("{}: expected a Draco mesh (bitstream 2.2) of {} triangles and {} vertices, {} attributes of "
                             "at most {} bytes a vertex in all, found {}",
                             place, triangles, vertices, attributes, attributes * kValueBytes, found)};
  };
  try {
    const auto sizes = peek_sizes(packed);
    if (!sizes) return wrong("another format, or too few bytes");
    if (sizes->triangles != triangles || sizes->vertices > vertices) {
      return wrong(fmt::format("{} triangles and {} vertices", sizes->triangles, sizes->vertices));
    }
    if (sizes->seam_tables > attributes) return wrong(fmt::format("seams of {} attributes", sizes->seam_tables));
    auto state = std::make_unique<State>();
    state->mesh = std::make_unique<draco::Mesh>();
    state->place = place;
    const auto decode = sizes->sequential ? decode_bounded<draco::MeshSequentialDecoder>
                                          : decode_bounded<draco::MeshEdgebreakerDecoder>;
    if (const std::string found = decode(packed, vertices, attributes, *state->mesh); !found.empty()) return wrong(found);
    if (state->mesh->num_faces() != triangles) return wrong(fmt::format("{} triangles", state->mesh->num_faces()));
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
