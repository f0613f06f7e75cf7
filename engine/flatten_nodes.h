// The node graph of the default scene, flattened: every mesh, camera and light with its world matrix.
// Called by engine/build_scene. Cost: one matrix product a node.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/affine_double.h"
#include "engine/scene_tables.h"
#include "io/gltf_accessor.h"
#include "io/result.h"

namespace shoal {

/// Something that a node carries, in scene order (depth first, children in order).
struct PlacedItem {
  uint32_t index = 0;  ///< of the mesh, camera or light
  uint32_t instancing_node = kNoIndex;  ///< EXT_mesh_gpu_instancing: to_world is the node's, until place_instancings()
  AffineDouble to_world;
  uint32_t node = kNoIndex;  ///< of cameras, and of meshes without EXT_mesh_gpu_instancing
  bool moves = false;        ///< while the shutter is open: an object of its own (engine/motion_keys)
};

struct FlatScene {
  std::vector<PlacedItem> meshes, cameras, lights;
  std::vector<std::string> warnings;  ///< nodes and instances left out because their matrix is not finite
};

/// Meshes that flatten_nodes() will place.
uint64_t count_placed_meshes(const gltf::Document& document);

/// Fails with: kInput (more meshes placed than limits.instances_count).
Result<FlatScene> flatten_nodes(const gltf::Document& document, const gltf::Limits& limits);

/// Gives each instance of EXT_mesh_gpu_instancing its own place; those without one are left out.
/// Fails with: kInput, kStorage.
Status place_instancings(gltf::BufferFiles& files, const gltf::Document& document, FlatScene& scene);

std::vector<CameraRecord> convert_cameras(const gltf::Document& document, const FlatScene& scene);
std::vector<PunctualLight> convert_lights(const gltf::Document& document, const FlatScene& scene);

/// `value` as a float in [lo, hi]; not a number becomes lo.
float clamped_float(double value, double lo, double hi);

}  // namespace shoal
