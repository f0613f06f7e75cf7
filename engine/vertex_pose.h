// Morph targets and skins, applied to the vertices of a window: what engine/pose_document found out for a mesh (weights
// of targets, matrices of joints) goes over positions, normals and tangents. Computed in double, rounded to float once.
// Called by engine/read_mesh. Thread rule: as its BufferFiles. Cost: a matrix sum a vertex and joint set; targets whose
// weight is 0 are not read.
#pragma once

#include "engine/affine_double.h"
#include "engine/attribute_window.h"

namespace shoal {

class VertexPose {
 public:
  /// Whether the primitive's vertices move.
  static bool needed(const gltf::Mesh& mesh, const gltf::Primitive& primitive);
  /// Windows that one takes, of 4 components at most: for the memory plan.
  static uint32_t window_count(const gltf::Mesh& mesh, const gltf::Primitive& primitive);

  /// `normals`, `tangents`: whether these are wanted. `place` names the primitive. Fails with: kInput, kStorage.
  static Result<VertexPose> open(gltf::BufferFiles& files, const gltf::Document& document, const gltf::Mesh& mesh,
                                 const gltf::Primitive& primitive, const std::string& place, bool normals,
                                 bool tangents, uint64_t vertex_count);

  template <class Function>
  Status each_window(Function function) {
    for (Target& target : targets_) {
      for (auto* window : {&target.position, &target.normal, &target.tangent}) {
        if (*window) SHOAL_RETURN_IF_ERROR(function(**window));
      }
    }
    for (JointSet& set : joint_sets_) {
      SHOAL_RETURN_IF_ERROR(function(set.joints));
      SHOAL_RETURN_IF_ERROR(function(set.weights));
    }
    return {};
  }

  bool skinned() const { return !joint_sets_.empty(); }
  /// All windows hold the same vertices. A window that is not there is null.
  void morph(AttributeWindow& position, AttributeWindow* normal, AttributeWindow* tangent) const;
  /// Moves positions to world space; normals and tangents become unit length or zero. `turned`: for each vertex whether
  /// its map mirrors. Requires: skinned(). Fails with: kInput (a joint that the skin has not).
  Status skin(AttributeWindow& position, AttributeWindow* normal, AttributeWindow* tangent,
              std::vector<uint8_t>& turned) const;

 private:
  struct Target {
    double weight = 0;
    std::optional<AttributeWindow> position, normal, tangent;
  };
  struct JointSet {
    AttributeWindow joints, weights;
  };
  Result<AffineDouble> blended(size_t vertex) const;

  std::vector<Target> targets_;
  std::vector<JointSet> joint_sets_;
  std::shared_ptr<const gltf::JointMatrices> matrices_;
  std::string place_;
};

}  // namespace shoal
