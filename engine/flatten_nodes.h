// The node graph of the default scene, flattened: every mesh, camera and light with its world matrix.
// Called by engine/build_scene. Cost: one matrix product a node.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/affine_double.h"
#include "engine/scene_tables.h"
#include "io/gltf_document.h"
#include "io/result.h"

namespace shoal {

/// Something that a node carries, in scene order (depth first, children in order).
struct PlacedItem {
  uint32_t index = 0;  ///< of the mesh, camera or light
  AffineDouble to_world;
};

struct FlatScene {
  std::vector<PlacedItem> meshes, cameras, lights;
  std::vector<std::string> warnings;  ///< nodes left out because their matrix is not finite
};

/// Fails with: kInput (more meshes placed than limits.instances_count).
Result<FlatScene> flatten_nodes(const gltf::Document& document, const gltf::Limits& limits);

std::vector<CameraRecord> convert_cameras(const gltf::Document& document, const FlatScene& scene);
std::vector<PunctualLight> convert_lights(const gltf::Document& document, const FlatScene& scene);

/// `value` as a float in [lo, hi]; not a number becomes lo.
float clamped_float(double value, double lo, double hi);

}  // namespace shoal
