// A document posed at one time: nodes that an animation moves get their matrices, meshes the weights of their morph
// targets and the matrices of their joints. What follows in the build sees a scene at rest; vertices are moved where they
// are read (engine/vertex_pose). A mesh that several nodes show in different poses becomes one mesh for each.
// Called by engine/build_scene. Thread rule: one thread. Cost: one pass over the times of the animation, one matrix a
// joint; nothing for a scene without skins, morph targets and a time.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "io/gltf_accessor.h"

namespace shoal {

struct Scene;

/// What is asked for; nothing: nodes at rest.
struct PoseOptions {
  std::optional<double> time;  ///< seconds; without it, but with an animation: 0
  std::string animation;       ///< name or index; empty: the first
  bool wanted() const { return time.has_value() || !animation.empty(); }
};

struct ChosenPose {
  uint32_t animation = 0;
  std::string name;
  double time = 0;
};

/// Nothing: nodes at rest. Fails with: kUsage (no such animation, or none at all; a time that is not finite).
Result<std::optional<ChosenPose>> choose_pose(const gltf::Document& document, const PoseOptions& options);

/// Of a document that is not posed yet: matrices of joints, and the meshes that are shown in several poses, at most.
uint64_t pose_bytes(const gltf::Document& document);

/// Requires: nothing that the pose reads is compressed any more. Fails with: kInput (data that is not finite, increasing
/// or of the right length, with its place), kStorage.
Status pose_document(gltf::BufferFiles& files, gltf::Document& document, const std::optional<ChosenPose>& pose,
                     std::vector<std::string>& warnings);

/// Whether a built scene is posed as asked; asking for nothing is always answered. Fails with: kUsage.
Status check_pose(const Scene& scene, const PoseOptions& options);

}  // namespace shoal
