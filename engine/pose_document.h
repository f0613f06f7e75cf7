// A document posed at one time: nodes that an animation moves get their matrices, meshes the weights of their morph
// targets and the matrices of their joints. What follows in the build sees a scene at rest; vertices are moved where they
// are read (engine/vertex_pose). A mesh that several nodes show in different poses becomes one mesh for each.
// Called by engine/build_scene. Thread rule: one thread. Cost: one pass over the times of the animation, one matrix a
// joint; nothing for a scene without skins, morph targets and a time.
#pragma once

#include <array>
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
  /// --shutter: open from and to so many seconds after `time`.
  std::optional<std::array<double, 2>> shutter{};
  bool wanted() const { return time.has_value() || !animation.empty() || shutter.has_value(); }
};

/// "a:b". Fails with: kUsage.
Result<std::array<double, 2>> parse_shutter(const std::string& text);

struct ChosenPose {
  uint32_t animation = 0;
  std::string name;
  double time = 0;             ///< as asked for
  std::optional<std::array<double, 2>> shutter;  ///< as asked for
  double open = 0, close = 0;  ///< of the shutter, on the animation's clock; the same: it is instantaneous
  bool has_shutter() const { return close > open; }
  double middle() const { return 0.5 * open + 0.5 * close; }
};

/// Nothing: nodes at rest. Fails with: kUsage (no such animation, or none at all; a time that is not finite), kInput
/// (the animation is broken).
Result<std::optional<ChosenPose>> choose_pose(const gltf::Document& document, const PoseOptions& options);

/// Of a document that is not posed yet: matrices of joints, and the meshes that are shown in several poses, at most.
uint64_t pose_bytes(const gltf::Document& document);

/// Moves the nodes, and sets their weights, as the animation has them at `time`; to be called as often as wanted.
/// Fails with: as pose_document().
Status animate(gltf::BufferFiles& files, gltf::Document& document, uint32_t animation, double time);

/// With a shutter, as in the middle of it. Requires: nothing that the pose reads is compressed any more.
/// Fails with: kInput (data that is not finite, increasing or of the right length, with its place), kStorage.
Status pose_document(gltf::BufferFiles& files, gltf::Document& document, const std::optional<ChosenPose>& pose,
                     std::vector<std::string>& warnings);

/// Whether a built scene is posed as asked; asking for nothing is always answered. Fails with: kUsage.
Status check_pose(const Scene& scene, const PoseOptions& options);

}  // namespace shoal
