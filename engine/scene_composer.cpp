#include "engine/scene_composer.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "engine/math.h"

namespace shoal {

void MeshData::append(const MeshData& other) {
  const auto base = static_cast<uint32_t>(positions.size());
  positions.insert(positions.end(), other.positions.begin(), other.positions.end());
  normals.insert(normals.end(), other.normals.begin(), other.normals.end());
  uvs.insert(uvs.end(), other.uvs.begin(), other.uvs.end());
  colors.insert(colors.end(), other.colors.begin(), other.colors.end());
  for (const uint32_t index : other.indices) indices.push_back(base + index);
}

std::array<double, 16> Placement::matrix() const {
  return {x.x, x.y, x.z, 0, y.x, y.y, y.z, 0, z.x, z.y, z.z, 0, origin.x, origin.y, origin.z, 1};
}

Placement facing(const Vec3& origin, const Vec3& forward, const Vec3& up, float scale) {
  const Vec3 z = glm::normalize(forward);
  const Vec3 x = glm::normalize(glm::cross(up, z));
  const Vec3 y = glm::cross(z, x);
  return {x * scale, y * scale, z * scale, origin};
}

Placement turned(const Vec3& origin, float radians, const Vec3& scale) {
  const SinCos angle = sin_cos(radians);
  return {Vec3(angle.cos, 0, -angle.sin) * scale.x, Vec3(0, 1, 0) * scale.y,
          Vec3(angle.sin, 0, angle.cos) * scale.z, origin};
}

gltf::Material rough_material(const std::string& name, const Vec3& base_color, double roughness) {
  gltf::Material material;
  material.name = name;
  material.base_color = {base_color.x, base_color.y, base_color.z, 1};
  material.metallic = 0;
  material.roughness = roughness;
  return material;
}

gltf::Material metal_material(const std::string& name, const Vec3& base_color, double roughness) {
  gltf::Material material = rough_material(name, base_color, roughness);
  material.metallic = 1;
  return material;
}

gltf::Material emissive_material(const std::string& name, const Vec3& radiance) {
  gltf::Material material = rough_material(name, Vec3(0));
  const float strength = std::max(radiance.x, std::max(radiance.y, radiance.z));
  material.emissive = {radiance.x / strength, radiance.y / strength, radiance.z / strength};
  material.emissive_strength = strength;
  material.specular = 0;
  return material;
}

uint32_t add_material(gltf::Document& document, gltf::Material material) {
  document.materials.push_back(std::move(material));
  return static_cast<uint32_t>(document.materials.size() - 1);
}

uint32_t add_texture(gltf::Document& document, const std::string& uri, bool clamp) {
  gltf::Sampler sampler;
  if (clamp) sampler.wrap_s = sampler.wrap_t = 33071;
  document.samplers.push_back(sampler);
  gltf::Image image;
  image.path = uri;
  document.images.push_back(image);
  gltf::Texture texture;
  texture.sampler = static_cast<uint32_t>(document.samplers.size() - 1);
  texture.image = static_cast<uint32_t>(document.images.size() - 1);
  document.textures.push_back(texture);
  return static_cast<uint32_t>(document.textures.size() - 1);
}

uint32_t add_mesh(gltf::Document& document, gltf::Mesh mesh) {
  document.meshes.push_back(std::move(mesh));
  return static_cast<uint32_t>(document.meshes.size() - 1);
}

namespace {

void add_root(gltf::Document& document, gltf::Node node) {
  document.roots.push_back(static_cast<uint32_t>(document.nodes.size()));
  document.nodes.push_back(std::move(node));
}

}  // namespace

void add_mesh_node(gltf::Document& document, uint32_t mesh, const Placement& placement, const std::string& name) {
  gltf::Node node;
  node.name = name;
  node.mesh = mesh;
  node.matrix = placement.matrix();
  add_root(document, node);
}

void add_camera(gltf::Document& document, const std::string& name, const Vec3& eye, const Vec3& target,
                double yfov_radians) {
  gltf::Camera camera;
  camera.name = name;
  camera.yfov = yfov_radians;
  document.cameras.push_back(camera);
  gltf::Node node;
  node.name = name;
  node.camera = static_cast<uint32_t>(document.cameras.size() - 1);
  node.matrix = facing(eye, eye - target, Vec3(0, 1, 0)).matrix();  // a camera looks along -z
  add_root(document, node);
}

void add_sun(gltf::Document& document, const Vec3& direction, const Vec3& color, double lux) {
  gltf::Light light;
  light.name = "sun";
  light.type = gltf::LightType::kDirectional;
  light.color = {color.x, color.y, color.z};
  light.intensity = lux;
  document.lights.push_back(light);
  gltf::Node node;
  node.name = "sun";
  node.light = static_cast<uint32_t>(document.lights.size() - 1);
  node.matrix = facing(Vec3(0), -direction, Vec3(0, 1, 0)).matrix();  // a light shines along -z
  add_root(document, node);
}

gltf::Primitive write_mesh(GltfWriter& writer, const MeshData& mesh, uint32_t material) {
  const auto floats = [&](AccessorKind kind, const auto& values) {
    writer.begin_accessor(kind, values.size());
    writer.append_floats({&values[0].x, values.size() * (sizeof(values[0]) / sizeof(float))});
    return writer.end_accessor();
  };
  gltf::Primitive primitive;
  primitive.attributes["POSITION"] = floats(AccessorKind::kPosition, mesh.positions);
  if (!mesh.normals.empty()) primitive.attributes["NORMAL"] = floats(AccessorKind::kVec3, mesh.normals);
  if (!mesh.uvs.empty()) primitive.attributes["TEXCOORD_0"] = floats(AccessorKind::kVec2, mesh.uvs);
  if (!mesh.colors.empty()) primitive.attributes["COLOR_0"] = floats(AccessorKind::kVec4, mesh.colors);
  writer.begin_accessor(mesh.positions.size() <= 65535 ? AccessorKind::kIndex16 : AccessorKind::kIndex32,
                        mesh.indices.size());
  writer.append_indices(mesh.indices);
  primitive.indices = writer.end_accessor();
  primitive.material = material;
  return primitive;
}

uint32_t write_single_mesh(GltfWriter& writer, const std::string& name, const MeshData& mesh, uint32_t material) {
  gltf::Mesh shown;
  shown.name = name;
  shown.primitives.push_back(write_mesh(writer, mesh, material));
  return add_mesh(writer.document(), std::move(shown));
}

MeshData rectangle(const Vec3& center, const Vec3& half_u, const Vec3& half_v) {
  MeshData mesh;
  mesh.positions = {center - half_u - half_v, center + half_u - half_v, center + half_u + half_v,
                    center - half_u + half_v};
  mesh.uvs = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
  mesh.indices = {0, 1, 2, 0, 2, 3};
  return mesh;
}

MeshData unit_sphere(uint32_t cells) {
  // Longitude and latitude, so that textures wrap: 12 n^2 triangles from 3n meridians and 2n parallels or so.
  const uint32_t around = 3 * cells, up = 2 * cells + 1;
  MeshData mesh;
  for (uint32_t j = 0; j <= up; ++j) {
    const float v = static_cast<float>(j) / static_cast<float>(up);
    const SinCos polar = sin_cos(kPi * v);
    for (uint32_t i = 0; i <= around; ++i) {
      const float u = static_cast<float>(i) / static_cast<float>(around);
      const SinCos turn = i == around ? SinCos{0, 1} : sin_cos(2 * kPi * u);
      const bool pole = j == 0 || j == up;
      const Vec3 p =
          pole ? Vec3(0, j == 0 ? 1 : -1, 0) : Vec3(polar.sin * turn.cos, polar.cos, -polar.sin * turn.sin);
      mesh.positions.push_back(p);
      mesh.normals.push_back(p);
      mesh.uvs.push_back({u, v});
    }
  }
  for (uint32_t j = 0; j < up; ++j) {
    for (uint32_t i = 0; i < around; ++i) {
      const uint32_t a = j * (around + 1) + i, c = a + around + 1;
      if (j > 0) mesh.add_triangle(a, c + 1, a + 1);
      if (j + 1 < up) mesh.add_triangle(a, c, c + 1);
    }
  }
  return mesh;
}

MeshData tube(const std::vector<Vec3>& points, const std::vector<float>& radii, uint32_t sides) {
  MeshData mesh;
  Vec3 side(1, 0, 0);
  float length = 0;
  for (size_t k = 0; k < points.size(); ++k) {
    const Vec3 along = glm::normalize(points[std::min(k + 1, points.size() - 1)] - points[k == 0 ? 0 : k - 1]);
    if (std::abs(glm::dot(along, side)) > 0.95f) side = std::abs(along.y) < 0.7f ? Vec3(0, 1, 0) : Vec3(0, 0, 1);
    side = glm::normalize(side - along * glm::dot(side, along));  // carried along: the tube does not twist
    const Vec3 other = glm::cross(along, side);
    if (k > 0) length += glm::length(points[k] - points[k - 1]);
    for (uint32_t s = 0; s <= sides; ++s) {
      const float u = static_cast<float>(s) / static_cast<float>(sides);
      const SinCos turn = s == sides ? SinCos{0, 1} : sin_cos(2 * kPi * u);
      const Vec3 normal = side * turn.cos + other * turn.sin;
      mesh.positions.push_back(points[k] + normal * radii[k]);
      mesh.normals.push_back(normal);
      mesh.uvs.push_back({u, length});
    }
  }
  for (uint32_t k = 0; k + 1 < points.size(); ++k) {
    for (uint32_t s = 0; s < sides; ++s) {
      const uint32_t a = k * (sides + 1) + s, c = a + sides + 1;
      mesh.add_triangle(a, a + 1, c + 1);
      mesh.add_triangle(a, c + 1, c);
    }
  }
  return mesh;
}

void compute_normals(MeshData& mesh) {
  // Vertices at one place (seams of uv) share their normal.
  std::map<std::tuple<float, float, float>, Vec3> sums;
  const auto key = [&](uint32_t i) {
    const Vec3& p = mesh.positions[i];
    return std::make_tuple(p.x, p.y, p.z);
  };
  for (size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    const uint32_t* corner = &mesh.indices[i];
    const Vec3& p = mesh.positions[corner[0]];
    const Vec3 weighted = glm::cross(mesh.positions[corner[1]] - p, mesh.positions[corner[2]] - p);
    for (int k = 0; k < 3; ++k) sums.try_emplace(key(corner[k]), Vec3(0)).first->second += weighted;
  }
  mesh.normals.resize(mesh.positions.size());
  for (uint32_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3 sum = sums.try_emplace(key(i), Vec3(0)).first->second;
    const float length = glm::length(sum);
    mesh.normals[i] = length > 0 ? sum / length : Vec3(0, 1, 0);
  }
}

}  // namespace shoal
