// Which triangles become which object, before any of them is read. A mesh that one node shows, and that stands still,
// is baked into the world object (object 0, instance 0, identity); any other mesh is an object of its own, stored
// once and instanced, however small it is: treelets hold small objects well, and a rule without sizes is easy to
// predict. Called by engine/build_scene. Cost: nothing is read but accessor counts.
#pragma once

#include <vector>

#include "engine/flatten_nodes.h"
#include "engine/read_mesh.h"

namespace shoal {

/// The triangles of a mesh and the nodes (FlatScene::meshes) that show it, in scene order.
struct MeshPlan {
  std::vector<PrimitiveSource> primitives;
  std::vector<uint32_t> placements;
  bool moves = false;  ///< one of them does: not baked
};

struct ObjectPlan {
  std::vector<uint32_t> meshes;  ///< the world object: every baked mesh; else one mesh
  bool baked = false;
};

struct GeometryPlan {
  std::vector<MeshPlan> meshes;     ///< document order; without placements: not shown, not read
  std::vector<ObjectPlan> objects;  ///< the world object first, if there is anything in it
  std::vector<MaterialUse> uses;    ///< for plan_materials()
  std::vector<std::string> warnings;
};

/// Global primitive ids count (mesh in document order, primitive, triangle) over the meshes shown.
/// `files`: null where what is compressed was not decompressed yet: nothing is read then.
/// Fails with: kInput (more triangles than ids, a primitive's accessors).
Result<GeometryPlan> plan_geometry(gltf::BufferFiles* files, const gltf::Document& document,
                                   const FlatScene& scene);

CornerLayout object_layout(const gltf::Document& document, const GeometryPlan& geometry, const ObjectPlan& object,
                           const MaterialPlan& materials);
/// Windows that the primitive which is morphed or skinned by most accessors takes (VertexPose::window_count).
uint32_t most_pose_windows(const gltf::Document& document, const GeometryPlan& geometry);
uint64_t object_triangles(const GeometryPlan& geometry, const ObjectPlan& object);

}  // namespace shoal
