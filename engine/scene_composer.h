// Short hands for filling a gltf::Document: materials, lights, cameras, nodes, and small meshes held in memory.
// Called by engine/generate_*. Plain functions, one thread.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/gltf_writer.h"
#include "treelets/vector.h"

namespace shoal {

/// A small mesh in memory. `normals`, `uvs`, `colors` are empty or one a position.
struct MeshData {
  std::vector<Vec3> positions, normals;
  std::vector<Vec2> uvs;
  std::vector<Vec4> colors;
  std::vector<uint32_t> indices;

  uint64_t triangles_count() const { return indices.size() / 3; }
  void add_triangle(uint32_t a, uint32_t b, uint32_t c) { indices.insert(indices.end(), {a, b, c}); }
  /// Appends another mesh with the same attributes.
  void append(const MeshData& other);
};

/// A placement: columns are the images of the axes.
struct Placement {
  Vec3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1}, origin{0};

  Vec3 point(const Vec3& p) const { return x * p.x + y * p.y + z * p.z + origin; }
  Vec3 vector(const Vec3& v) const { return x * v.x + y * v.y + z * v.z; }
  std::array<double, 16> matrix() const;
};
/// A frame with z along `forward` and y near `up`. Requires: forward not zero, not along up.
Placement facing(const Vec3& origin, const Vec3& forward, const Vec3& up, float scale = 1);
/// Turned about +y by `radians`, then scaled.
Placement turned(const Vec3& origin, float radians, const Vec3& scale);

gltf::Material rough_material(const std::string& name, const Vec3& base_color, double roughness = 1);
gltf::Material metal_material(const std::string& name, const Vec3& base_color, double roughness);
/// Emits `radiance` and reflects nothing of note.
gltf::Material emissive_material(const std::string& name, const Vec3& radiance);

uint32_t add_material(gltf::Document& document, gltf::Material material);
/// A texture of an image file in the scene's folder.
uint32_t add_texture(gltf::Document& document, const std::string& uri, bool clamp = false);
uint32_t add_mesh(gltf::Document& document, gltf::Mesh mesh);
/// A root node that shows a mesh.
void add_mesh_node(gltf::Document& document, uint32_t mesh, const Placement& placement = {},
                   const std::string& name = {});
void add_camera(gltf::Document& document, const std::string& name, const Vec3& eye, const Vec3& target,
                double yfov_radians);
/// A light that shines along `direction`.
void add_sun(gltf::Document& document, const Vec3& direction, const Vec3& color, double lux);

/// Streams a small mesh. Requires: at least one triangle.
gltf::Primitive write_mesh(GltfWriter& writer, const MeshData& mesh, uint32_t material);
/// The same as a mesh of its own; returns its index.
uint32_t write_single_mesh(GltfWriter& writer, const std::string& name, const MeshData& mesh, uint32_t material);

/// A rectangle about `center` spanned by two half edges, two triangles, with uv (v down).
MeshData rectangle(const Vec3& center, const Vec3& half_u, const Vec3& half_v);
/// A unit sphere of 12 cells^2 triangles with normals and longitude-latitude uv.
MeshData unit_sphere(uint32_t cells);
/// A tube through points, `sides` round, with normals and uv; open ends. Requires: two points or more.
MeshData tube(const std::vector<Vec3>& points, const std::vector<float>& radii, uint32_t sides);
/// Normals as area-weighted means of the faces about each vertex.
void compute_normals(MeshData& mesh);

}  // namespace shoal
