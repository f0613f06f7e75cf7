// Where the nodes of a scene stand while its shutter is open: for each node that moves and has a mesh or a camera, its
// world matrix at even times, so many that what lies between two of them is close to a straight line. Rigid meshes only:
// what is skinned or morphed stays as it is in the middle of the shutter, and so do lights.
// Called by engine/build_scene. Thread rule: one thread. Cost: the animation is sampled once a key.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "engine/affine_double.h"
#include "engine/flatten_nodes.h"
#include "engine/pose_document.h"

namespace shoal {

struct MotionKeys {
  uint32_t key_count = 0;  ///< 0: nothing moves
  using Nodes = std::map<uint32_t, std::vector<AffineDouble>>;  ///< world matrices of a node that moves, by time
  Nodes meshes;   ///< of nodes that show a rigid mesh
  Nodes cameras;  ///< of nodes that have a camera
  std::vector<std::string> warnings;                    ///< what is not blurred
};

/// `most_rows`: of matrices, all keys of all nodes. Leaves `document` as at some key: engine/pose_document follows.
/// Requires: pose.has_shutter().
/// Fails with: kInput, kStorage, as pose_document().
Result<MotionKeys> find_motion(gltf::BufferFiles& files, gltf::Document& document, const ChosenPose& pose,
                               uint64_t most_rows);
/// The keys of all cameras that move, which the rows of `cameras` (parallel to scene.cameras) are told.
std::vector<Affine3> add_camera_keys(const MotionKeys& motion, const FlatScene& scene,
                                     std::vector<CameraRecord>& cameras);
/// Matrices that a build may hold under this cap; motion is coarser where there are more.
uint64_t most_motion_rows(uint64_t cap_bytes);

}  // namespace shoal
