// A wall of quads, each with a texture of its own full of noise, seen by a camera: a scene that is nearly all texture.
// Used by tests/engine and tests/bins.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "tests/support/written_scene.h"

namespace shoal::testing {

/// `count` quads side by side, textures of `side` x `side` texels; images go to `fs`. The wall faces the camera.
inline WrittenScene textured_quads(MemoryFileSystem& fs, uint32_t count, uint32_t side) {
  WrittenScene scene;
  std::mt19937 random(1);
  for (uint32_t i = 0; i < count; ++i) {
    std::vector<uint8_t> texels(size_t{4} * side * side);
    for (uint8_t& texel : texels) texel = static_cast<uint8_t>(random());
    const uint32_t texture = scene.add_texture(fs, side, side, texels);
    scene.json["materials"].push_back({{"pbrMetallicRoughness",
                                        {{"baseColorTexture", {{"index", texture}}}, {"metallicFactor", 0}}}});
    const float x = static_cast<float>(i);
    const nlohmann::json attributes = {
        {"POSITION", scene.add_floats(3, {x, 0, 0, x + 1, 0, 0, x + 1, 1, 0, x, 1, 0})},
        {"TEXCOORD_0", scene.add_floats(2, {0, 1, 1, 1, 1, 0, 0, 0})}};
    const uint32_t mesh = scene.add_mesh(
        {{"attributes", attributes}, {"indices", scene.add_indices({0, 1, 2, 0, 2, 3})}, {"material", i}});
    scene.add_node({{"mesh", mesh}});
  }
  const float half = 0.5f * static_cast<float>(count);
  scene.json["cameras"] = {{{"type", "orthographic"},
                            {"orthographic", {{"xmag", half}, {"ymag", 0.5f}, {"znear", 0}, {"zfar", 10}}}}};
  scene.add_node({{"camera", 0}, {"translation", {half, 0.5f, 2}}});
  return scene;
}

}  // namespace shoal::testing
