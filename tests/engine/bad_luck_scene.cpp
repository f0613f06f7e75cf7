#include "tests/engine/bad_luck_scene.h"

#include <random>

#include "tests/support/written_scene.h"

namespace shoal::testing {

void save_bad_luck_scene(MemoryFileSystem& fs, uint32_t triangles) {
  WrittenScene scene;
  std::mt19937 random(5);
  const auto uniform = [&] { return static_cast<float>(random() % 1000) * 0.001f; };
  std::vector<float> positions, uvs;
  for (uint32_t i = 0; i < triangles; ++i) {
    const float center[3] = {uniform() * 4, uniform() * 4, uniform() * 4};
    for (int corner = 0; corner < 3; ++corner) {
      for (const float c : center) positions.push_back(c + 0.4f * uniform());
      for (int axis = 0; axis < 2; ++axis) uvs.push_back(uniform());
    }
  }
  std::vector<uint8_t> rgba(100 * 90 * 4);
  for (uint8_t& byte : rgba) byte = static_cast<uint8_t>(random());
  const uint32_t texture = scene.add_texture(fs, 100, 90, rgba);
  // Without a specular lobe: its table would take most of the time of a small render.
  scene.json["extensionsUsed"] = {"KHR_materials_specular"};
  scene.json["materials"] = {
      {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}}}, {"metallicFactor", 0}}},
       {"extensions", {{"KHR_materials_specular", {{"specularFactor", 0}}}}}}};
  const uint32_t position = scene.add_floats(3, positions), uv = scene.add_floats(2, uvs);
  scene.add_mesh({{"attributes", {{"POSITION", position}, {"TEXCOORD_0", uv}}}, {"material", 0}});
  scene.add_node({{"mesh", 0}});
  scene.save(fs);
}

}  // namespace shoal::testing
