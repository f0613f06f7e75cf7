#include "bench/load_triangles.h"

#include <algorithm>
#include <span>

#include "engine/generate.h"
#include "io/gltf_accessor.h"

namespace shoal::bench {
namespace {

Status append(gltf::BufferFiles& files, const gltf::Document& document, const gltf::Primitive& primitive,
              Triangles& out) {
  SHOAL_ASSIGN_OR_RETURN(gltf::TriangleStream stream, gltf::TriangleStream::open(files, document, primitive));
  if (stream.count() == 0) return {};
  const size_t first_index = out.indices.size();
  const auto base = static_cast<uint32_t>(out.vertices.size() / 3);
  out.indices.resize(first_index + 3 * stream.count());
  SHOAL_RETURN_IF_ERROR(stream.read(0, stream.count(), std::span(out.indices).subspan(first_index)));
  for (size_t i = first_index; i < out.indices.size(); ++i) out.indices[i] += base;
  SHOAL_ASSIGN_OR_RETURN(gltf::AccessorReader positions,
                         gltf::AccessorReader::open(files, document, primitive.attributes.at("POSITION")));
  out.vertices.resize(3 * (base + stream.vertex_count()));
  return positions.read_floats(0, stream.vertex_count(), std::span(out.vertices).subspan(3 * base));
}

}  // namespace

Result<Triangles> read_triangles(const std::string& gltf_path) {
  SHOAL_ASSIGN_OR_RETURN(const gltf::Document document, gltf::load_document(posix_file_system(), gltf_path));
  gltf::BufferFiles files(posix_file_system(), document);
  Triangles out;
  for (const gltf::Mesh& mesh : document.meshes) {
    for (const gltf::Primitive& primitive : mesh.primitives) {
      SHOAL_RETURN_IF_ERROR(append(files, document, primitive, out));
    }
  }
  out.vertices.push_back(0);
  return out;
}

std::vector<float> corner_positions(const Triangles& triangles) {
  std::vector<float> positions(3 * triangles.indices.size());
  for (size_t i = 0; i < triangles.indices.size(); ++i) {
    std::copy_n(&triangles.vertices[3 * size_t{triangles.indices[i]}], 3, &positions[3 * i]);
  }
  return positions;
}

Result<std::string> generate_terrain(const std::string& folder, uint64_t triangles) {
  GenerateOptions options;
  options.kind = "terrain";
  options.triangles = triangles;
  options.out_dir = folder;
  SHOAL_ASSIGN_OR_RETURN(const GenerateReport report, generate_scene(posix_file_system(), options));
  return report.gltf_path;
}

}  // namespace shoal::bench
