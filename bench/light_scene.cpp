#include "bench/light_scene.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <vector>

#include "io/file.h"
#include "treelets/vector.h"

namespace shoal::bench {
namespace {

using Json = nlohmann::ordered_json;

constexpr float kHall = 20;        // side of the floor
constexpr float kLowest = 3.5f, kHighest = 7;  // of lights: above the boxes
constexpr float kFromWalls = 0.5f;             // of lights
constexpr double kFlux = 2000;  // of all lights: chosen for pictures of about mid-grey
constexpr int kBoxes = 60;

/// Numbers in [lo, hi), the same everywhere (std::uniform_real_distribution is not).
class Numbers {
 public:
  float operator()(float lo, float hi) { return lo + (hi - lo) * static_cast<float>(engine_() >> 8) * 0x1p-24f; }

 private:
  std::mt19937 engine_{7};
};

struct Mesh {
  std::vector<float> positions;

  void triangle(const Vec3& a, const Vec3& b, const Vec3& c) {
    for (const Vec3& p : {a, b, c}) positions.insert(positions.end(), {p.x, p.y, p.z});
  }
  void square(const Vec3& corner, const Vec3& a, const Vec3& b) {
    triangle(corner, corner + a, corner + a + b);
    triangle(corner, corner + a + b, corner + b);
  }
  void box(const Vec3& corner, const Vec3& x, const Vec3& y, const Vec3& z) {
    for (const auto& [at, a, b] : {std::tuple(corner, x, y), std::tuple(corner, y, z), std::tuple(corner, z, x),
                                   std::tuple(corner + z, x, y), std::tuple(corner + x, y, z),
                                   std::tuple(corner + y, z, x)}) {
      square(at, a, b);
    }
  }
};

Vec3 random_direction(Numbers& number) {
  const float z = number(-1, 1), phi = number(0, 2 * std::numbers::pi_v<float>), r = std::sqrt(1 - z * z);
  return {r * std::cos(phi), z, r * std::sin(phi)};
}

Mesh hall(Numbers& number) {
  Mesh mesh;
  const float h = kHall / 2;
  mesh.square({-h, 0, -h}, {0, 0, kHall}, {kHall, 0, 0});
  mesh.square({-h, 0, -h}, {kHall, 0, 0}, {0, 8, 0});
  mesh.square({-h, 0, -h}, {0, 8, 0}, {0, 0, kHall});
  mesh.square({h, 0, -h}, {0, 0, kHall}, {0, 8, 0});
  for (int i = 0; i < kBoxes; ++i) {
    const float angle = number(0, 3), wide = number(0.3f, 1), high = number(0.3f, 2.5f);
    const Vec3 x(wide * std::cos(angle), 0, wide * std::sin(angle)), z(-x.z, 0, x.x);
    mesh.box({number(-h, h - 1), 0, number(-h, h - 1)}, x, {0, high, 0}, z);
  }
  return mesh;
}

Json add_mesh(Json& json, std::string& binary, const Mesh& mesh, uint32_t material) {
  const size_t bytes = mesh.positions.size() * sizeof(float);
  json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", bytes}});
  binary.append(reinterpret_cast<const char*>(mesh.positions.data()), bytes);
  json["accessors"].push_back({{"bufferView", json["bufferViews"].size() - 1},
                               {"componentType", 5126},
                               {"count", mesh.positions.size() / 3},
                               {"type", "VEC3"},
                               {"min", {-kHall, -kHall, -kHall}},
                               {"max", {kHall, kHall, kHall}}});
  json["meshes"].push_back({{"primitives", Json::array({{{"attributes", {{"POSITION", json["accessors"].size() - 1}}},
                                                         {"material", material}}})}});
  return {{"mesh", json["meshes"].size() - 1}};
}

}  // namespace

Result<std::string> write_light_scene(const std::string& folder, uint32_t lights) {
  Numbers number;
  Json json = {{"asset", {{"version", "2.0"}}}, {"scene", 0}, {"extensionsUsed", {"KHR_lights_punctual",
               "KHR_materials_emissive_strength"}}};
  std::string binary;
  Json nodes = Json::array(), punctual = Json::array();
  nodes.push_back(add_mesh(json, binary, hall(number), 0));

  const uint32_t squares = (lights + 1) / 2;
  const double flux = kFlux / lights;
  // The more there are, the smaller: as far apart in their own size.
  const float side = 0.5f * std::cbrt(10.0f / static_cast<float>(lights));
  const auto place = [&] {
    const float h = kHall / 2 - kFromWalls;
    return Vec3(number(-h, h), number(kLowest, kHighest), number(-h, h));
  };
  Mesh lamps;
  for (uint32_t i = 0; i < lights; ++i) {
    const Vec3 at = place();
    if (i < squares) {
      const Vec3 normal = random_direction(number);
      const Vec3 a = glm::normalize(glm::cross(normal, std::abs(normal.x) < 0.6f ? Vec3(1, 0, 0) : Vec3(0, 1, 0)));
      lamps.square(at, a * side, glm::cross(normal, a) * side);
    } else {
      const double intensity = flux / (4 * std::numbers::pi);
      punctual.push_back({{"type", "point"}, {"intensity", intensity}, {"color", {1, 0.8, 0.5}}});
      nodes.push_back({{"translation", {at.x, at.y, at.z}},
                       {"extensions", {{"KHR_lights_punctual", {{"light", punctual.size() - 1}}}}}});
    }
  }
  nodes.push_back(add_mesh(json, binary, lamps, 1));
  const double radiance = flux / (2 * std::numbers::pi * side * side);
  json["materials"] = {
      {{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 0.6}, {"baseColorFactor", {0.7, 0.7, 0.7, 1}}}}},
      {{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"baseColorFactor", {0, 0, 0, 1}}}},
       {"emissiveFactor", {0.6, 0.8, 1}},
       {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", radiance}}}}}}};
  if (!punctual.empty()) json["extensions"] = {{"KHR_lights_punctual", {{"lights", punctual}}}};
  json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.9}, {"znear", 0.1}}}}};
  nodes.push_back({{"camera", 0}, {"translation", {0, 3, 9.5}}, {"rotation", {-0.2588, 0, 0, 0.96593}}});
  Json roots = Json::array();
  for (size_t i = 0; i < nodes.size(); ++i) roots.push_back(i);
  json["nodes"] = nodes;
  json["scenes"] = {{{"nodes", roots}}};
  json["buffers"] = {{{"uri", "lights.bin"}, {"byteLength", binary.size()}}};

  const std::string text = json.dump(), path = folder + "/lights.gltf";
  FileSystem& fs = posix_file_system();
  SHOAL_RETURN_IF_ERROR(write_whole_file(fs, folder + "/lights.bin", std::as_bytes(std::span(binary))));
  SHOAL_RETURN_IF_ERROR(write_whole_file(fs, path, std::as_bytes(std::span(text))));
  return path;
}

}  // namespace shoal::bench
