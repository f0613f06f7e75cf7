// A scene made for looking at one material: a cube with it under a lamp, on a matte floor before an even sky, with a
// camera; normals, tangents and two UV sets. Header only; for targets that link the engine.
#pragma once

#include "engine/build_scene.h"
#include "engine/render.h"
#include "tests/support/memory_file_system.h"
#include "tests/support/written_scene.h"

namespace shoal::testing {

using Json = nlohmann::json;

struct CubeScene {
  MemoryFileSystem fs;
  WrittenScene scene;
  uint32_t texture = 0;  ///< 4 x 4, all channels different, not flat
  EnvironmentOptions environment{EnvironmentOptions::Kind::kConstant, Vec3(0.4f), {}};
  LensOptions lens;

  /// `subject` is the material of the cube; its extensions are noted as used.
  explicit CubeScene(const Json& subject) {
    std::vector<uint8_t> rgba(4 * 4 * 4);
    for (size_t i = 0; i < rgba.size(); ++i) rgba[i] = static_cast<uint8_t>(60 + i * 73 % 190);
    texture = scene.add_texture(fs, 4, 4, rgba);
    scene.json["materials"] = {
        subject,
        {{"name", "lamp"},
         {"emissiveFactor", {1, 1, 1}},
         {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 4}}}}}},
        {{"name", "floor"},
         {"pbrMetallicRoughness", {{"baseColorFactor", {0.3, 0.5, 0.8, 1}}, {"metallicFactor", 0}}}}};
    Json used = {"KHR_materials_emissive_strength", "KHR_texture_transform"};
    if (subject.contains("extensions")) {
      for (const auto& [name, value] : subject["extensions"].items()) used.push_back(name);
    }
    scene.json["extensionsUsed"] = used;
    add_cube();
    add_quad({-1.5f, 4, -1.5f}, {0, 0, 3}, {3, 0, 0}, 1);
    add_quad({-6, -1.01f, -6}, {0, 0, 12}, {12, 0, 0}, 2);
    scene.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 0.1}}}}};
    scene.add_node({{"camera", 0}, {"translation", {0, 0.6, 6}}, {"rotation", {-0.05, 0, 0, 0.99875}}});
  }

  std::vector<float> picture(const ShadingOptions& shading, uint32_t samples = 8) {
    return rendered(shading, samples).rgba;
  }
  RenderResult rendered(const ShadingOptions& shading, uint32_t samples = 8) {
    scene.save(fs);
    const auto built = build_scene(fs, "scene.gltf", "scene.shoal", {});
    EXPECT_TRUE(built.ok()) << built.error().message;
    const auto opened = open_scene(fs, "scene.shoal", ReadMode::kBuffered, {});
    EXPECT_TRUE(opened.ok()) << opened.error().message;
    PictureOptions picture;
    picture.width = picture.height = 24;
    picture.samples = samples;
    picture.shading = shading;
    picture.shading.environment = environment;
    picture.lens = lens;
    auto result = render(fs, opened.value(), picture, {});
    EXPECT_TRUE(result.ok()) << result.error().message;
    return result.ok() ? std::move(result).value() : RenderResult{};
  }

 private:
  void add_primitive(const std::vector<float>& p, const std::vector<float>& n, const std::vector<float>& t,
                     const std::vector<float>& uv, uint32_t material) {
    const Json attributes = {{"POSITION", scene.add_floats(3, p)},
                             {"NORMAL", scene.add_floats(3, n)},
                             {"TANGENT", scene.add_floats(4, t)},
                             {"TEXCOORD_0", scene.add_floats(2, uv)}};
    scene.add_node({{"mesh", scene.add_mesh({{"attributes", attributes}, {"material", material}})}});
  }
  static void quad(const Vec3& corner, const Vec3& a, const Vec3& b, std::vector<float>& p, std::vector<float>& n,
                   std::vector<float>& t, std::vector<float>& uv) {
    const Vec3 normal = glm::normalize(glm::cross(a, b)), along = glm::normalize(a);
    for (const int k : {0, 1, 2, 0, 2, 3}) {
      const float u = k == 1 || k == 2 ? 1.0f : 0.0f, v = k >= 2 ? 1.0f : 0.0f;
      const Vec3 at = corner + a * u + b * v;
      p.insert(p.end(), {at.x, at.y, at.z}), n.insert(n.end(), {normal.x, normal.y, normal.z});
      t.insert(t.end(), {along.x, along.y, along.z, 1}), uv.insert(uv.end(), {u, v});
    }
  }
  void add_quad(const Vec3& corner, const Vec3& a, const Vec3& b, uint32_t material) {
    std::vector<float> p, n, t, uv;
    quad(corner, a, b, p, n, t, uv);
    add_primitive(p, n, t, uv, material);
  }
  void add_cube() {
    std::vector<float> p, n, t, uv;
    const Vec3 x(1.6f, 0, 0.9f), z(-0.9f, 0, 1.6f), y(0, 1.6f, 0), corner = Vec3(0, -1, 0) - 0.5f * (x + z);
    quad(corner, y, x, p, n, t, uv), quad(corner + z, x, y, p, n, t, uv);
    quad(corner, z, y, p, n, t, uv), quad(corner + x, y, z, p, n, t, uv);
    quad(corner, x, z, p, n, t, uv), quad(corner + y, z, x, p, n, t, uv);
    add_primitive(p, n, t, uv, 0);
  }
};

}  // namespace shoal::testing
