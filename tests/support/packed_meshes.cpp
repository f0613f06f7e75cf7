#include "tests/support/packed_meshes.h"

#include <draco/compression/decode.h>
#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>
#include <meshoptimizer.h>

#include <stdexcept>

namespace shoal::testing {

namespace {

std::string as_text(const std::vector<unsigned char>& bytes) { return {bytes.begin(), bytes.end()}; }

int add_attribute(draco::Mesh& mesh, draco::GeometryAttribute::Type type, const std::vector<float>& values,
                  uint32_t components) {
  draco::GeometryAttribute attribute;
  attribute.Init(type, nullptr, static_cast<int8_t>(components), draco::DT_FLOAT32, false, 4 * components, 0);
  const auto count = static_cast<uint32_t>(values.size() / components);
  const int id = mesh.AddAttribute(attribute, true, count);
  for (uint32_t i = 0; i < count; ++i) {
    mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i), &values[size_t{i} * components]);
  }
  return id;
}

std::vector<float> values_of(const draco::Mesh& mesh, uint32_t id, uint32_t components) {
  std::vector<float> values;
  const draco::PointAttribute* attribute = mesh.GetAttributeByUniqueId(id);
  for (draco::PointIndex i(0); i < mesh.num_points(); ++i) {
    float v[4];
    attribute->GetMappedValue(i, v);
    values.insert(values.end(), v, v + components);
  }
  return values;
}

}  // namespace

std::string pack_vertices(const void* values, size_t count, size_t stride) {
  std::vector<unsigned char> out(meshopt_encodeVertexBufferBound(count, stride));
  out.resize(meshopt_encodeVertexBuffer(out.data(), out.size(), values, count, stride));
  return as_text(out);
}

std::string pack_triangles(const std::vector<uint32_t>& indices, size_t vertex_count) {
  std::vector<unsigned char> out(meshopt_encodeIndexBufferBound(indices.size(), vertex_count));
  out.resize(meshopt_encodeIndexBuffer(out.data(), out.size(), indices.data(), indices.size()));
  return as_text(out);
}

std::string pack_sequence(const std::vector<uint32_t>& indices, size_t vertex_count) {
  std::vector<unsigned char> out(meshopt_encodeIndexSequenceBound(indices.size(), vertex_count));
  out.resize(meshopt_encodeIndexSequence(out.data(), out.size(), indices.data(), indices.size()));
  return as_text(out);
}

PackedDraco pack_draco(const DracoSource& source) {
  draco::Mesh mesh;
  mesh.set_num_points(static_cast<uint32_t>(source.positions.size() / 3));
  const int position = add_attribute(mesh, draco::GeometryAttribute::POSITION, source.positions, 3);
  const int normal =
      source.normals.empty() ? -1 : add_attribute(mesh, draco::GeometryAttribute::NORMAL, source.normals, 3);
  const int uv = source.uvs.empty() ? -1 : add_attribute(mesh, draco::GeometryAttribute::TEX_COORD, source.uvs, 2);
  for (const uint32_t components : source.hidden_components) {
    add_attribute(mesh, draco::GeometryAttribute::GENERIC, std::vector<float>(mesh.num_points() * components), components);
  }
  for (size_t i = 0; i + 2 < source.indices.size(); i += 3) {
    draco::Mesh::Face face;
    for (size_t k = 0; k < 3; ++k) face[k] = draco::PointIndex(source.indices[i + k]);
    mesh.AddFace(face);
  }
  draco::Encoder encoder;
  encoder.SetEncodingMethod(source.sequential ? draco::MESH_SEQUENTIAL_ENCODING : draco::MESH_EDGEBREAKER_ENCODING);
  if (source.quantization_bits > 0) {
    encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, source.quantization_bits);
  }
  draco::EncoderBuffer buffer;
  if (!encoder.EncodeMeshToBuffer(mesh, &buffer).ok()) throw std::runtime_error("a mesh that Draco does not encode");

  PackedDraco packed;
  packed.bytes.assign(buffer.data(), buffer.size());
  packed.position_id = mesh.attribute(position)->unique_id();
  if (normal >= 0) packed.normal_id = mesh.attribute(normal)->unique_id();
  if (uv >= 0) packed.uv_id = mesh.attribute(uv)->unique_id();
  draco::DecoderBuffer input;
  input.Init(buffer.data(), buffer.size());
  const auto decoded = draco::Decoder().DecodeMeshFromBuffer(&input);
  const draco::Mesh& out = *decoded.value();
  packed.positions = values_of(out, packed.position_id, 3);
  if (normal >= 0) packed.normals = values_of(out, packed.normal_id, 3);
  if (uv >= 0) packed.uvs = values_of(out, packed.uv_id, 2);
  for (draco::FaceIndex i(0); i < out.num_faces(); ++i) {
    for (const draco::PointIndex& corner : out.face(i)) packed.indices.push_back(corner.value());
  }
  return packed;
}

}  // namespace shoal::testing
