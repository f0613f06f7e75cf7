// A white box without a front, seen from before it: most of what it shows is light scattered more than once. Used by
// tests/engine and tests/bins.
#pragma once

#include "tests/support/written_scene.h"

namespace shoal::testing {

inline WrittenScene white_box() {
  WrittenScene scene;
  scene.json["materials"] = {{{"pbrMetallicRoughness",
                               {{"baseColorFactor", {0.9, 0.9, 0.9, 1}}, {"metallicFactor", 0}, {"roughnessFactor", 1}}},
                              {"doubleSided", true}}};
  const std::vector<float> corners = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1};
  const std::vector<uint32_t> faces = {0, 1, 2, 0, 2, 3, 0, 4, 5, 0, 5, 1, 3, 2, 6, 3, 6, 7,
                                       0, 3, 7, 0, 7, 4, 1, 5, 6, 1, 6, 2};
  const nlohmann::json attributes = {{"POSITION", scene.add_floats(3, corners)}};
  const uint32_t mesh = scene.add_mesh({{"attributes", attributes}, {"indices", scene.add_indices(faces)}, {"material", 0}});
  scene.add_node({{"mesh", mesh}});
  scene.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.8}, {"znear", 0.1}}}}};
  scene.add_node({{"camera", 0}, {"translation", {0.5, 0.5, 2}}});
  return scene;
}

}  // namespace shoal::testing
