// What `shoal info` says of an opened scene: counts, sizes, what a triangle costs in memory and on disk.
// Called by bins. Cost: one pass over the directory.
#pragma once

#include <string>

#include "engine/scene.h"

namespace shoal {

struct SceneDescription {
  uint64_t file_bytes = 0, table_bytes = 0, resident_bytes = 0;
  uint64_t triangles_count = 0, instanced_triangles_count = 0, degenerate_count = 0;
  uint64_t treelets_count = 0, instances_count = 0, objects_count = 0, top_nodes_count = 0;
  uint64_t materials_count = 0, textures_count = 0, emitters_count = 0, lights_count = 0, cameras_count = 0;
  uint64_t geometry_bytes = 0, geometry_stored_bytes = 0;  ///< decoded, in the file
  uint64_t attribute_bytes = 0, attribute_stored_bytes = 0;
  uint64_t texture_bytes = 0, texture_stored_bytes = 0;
  double geometry_bytes_per_triangle = 0;         ///< decoded: what traversal keeps resident
  double geometry_stored_bytes_per_triangle = 0;  ///< on disk
  double attribute_bytes_per_triangle = 0, attribute_stored_bytes_per_triangle = 0;
};

/// "exact", or how coarse the grid is and how far it moved a point at most.
std::string describe_positions(const SceneHeader& header);
SceneDescription describe_scene(const Scene& scene);
/// Lines of "name  value", for people.
std::string scene_description_text(const Scene& scene);
/// One JSON object: the numbers under their names, bounds, cameras, and the build record as "build".
std::string scene_description_json(const Scene& scene);

}  // namespace shoal
