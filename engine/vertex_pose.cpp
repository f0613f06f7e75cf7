#include "engine/vertex_pose.h"

#include <fmt/format.h>

#include <algorithm>

namespace shoal {

namespace {

constexpr uint32_t kMaxJointSets = 4;

/// Sets of joints and weights, from 0 on.
uint32_t joint_set_count(const gltf::Mesh& mesh, const gltf::Primitive& primitive) {
  if (!mesh.joints) return 0;
  uint32_t count = 0;
  while (count < kMaxJointSets && find_attribute(primitive, fmt::format("JOINTS_{}", count)) &&
         find_attribute(primitive, fmt::format("WEIGHTS_{}", count))) {
    ++count;
  }
  return count;
}

double weight_of(const gltf::Mesh& mesh, size_t target) {
  return target < mesh.weights.size() ? mesh.weights[target] : 0;
}

void add_scaled(AttributeWindow& values, const AttributeWindow& offsets, double weight) {
  for (size_t i = 0; i < values.count(); ++i) {
    float* v = values.vertex(i);
    const float* offset = offsets.vertex(i);
    for (int c = 0; c < 3; ++c) v[c] = static_cast<float>(v[c] + weight * offset[c]);
  }
}

void move_direction(float* v, const AffineDouble& map, double sign) {
  const Vec3d d = normalized_or_zero(map.vector({v[0], v[1], v[2]}));
  for (int c = 0; c < 3; ++c) v[c] = static_cast<float>(d[c] * sign);
}

}  // namespace

bool VertexPose::needed(const gltf::Mesh& mesh, const gltf::Primitive& primitive) {
  return window_count(mesh, primitive) > 0;
}

uint32_t VertexPose::window_count(const gltf::Mesh& mesh, const gltf::Primitive& primitive) {
  uint32_t count = 2 * joint_set_count(mesh, primitive);
  for (size_t t = 0; t < primitive.targets.size(); ++t) {
    const gltf::MorphTarget& target = primitive.targets[t];
    if (weight_of(mesh, t) == 0) continue;
    count += target.position.has_value() + target.normal.has_value() + target.tangent.has_value();
  }
  return count;
}

Result<VertexPose> VertexPose::open(gltf::BufferFiles& files, const gltf::Document& document, const gltf::Mesh& mesh,
                                    const gltf::Primitive& primitive, const std::string& place, bool normals,
                                    bool tangents, uint64_t vertex_count) {
  VertexPose pose;
  pose.place_ = fmt::format("{}: {}", document.path, place);
  pose.matrices_ = mesh.joints;
  for (size_t t = 0; t < primitive.targets.size(); ++t) {
    if (weight_of(mesh, t) == 0) continue;
    Target target;
    target.weight = mesh.weights[t];
    const auto open_window = [&](std::optional<uint32_t> accessor, const char* name,
                          std::optional<AttributeWindow>& window) -> Status {
      if (!accessor) return {};
      SHOAL_ASSIGN_OR_RETURN(window, AttributeWindow::open(files, document, *accessor,
                                                           fmt::format("{}.targets[{}].{}", place, t, name), 3, 3,
                                                           vertex_count));
      return {};
    };
    SHOAL_RETURN_IF_ERROR(open_window(primitive.targets[t].position, "POSITION", target.position));
    if (normals) SHOAL_RETURN_IF_ERROR(open_window(primitive.targets[t].normal, "NORMAL", target.normal));
    if (tangents) SHOAL_RETURN_IF_ERROR(open_window(primitive.targets[t].tangent, "TANGENT", target.tangent));
    pose.targets_.push_back(std::move(target));
  }
  for (uint32_t s = 0; s < joint_set_count(mesh, primitive); ++s) {
    const std::string joints = fmt::format("JOINTS_{}", s), weights = fmt::format("WEIGHTS_{}", s);
    const uint32_t joint_accessor = *find_attribute(primitive, joints);
    const uint32_t weight_accessor = *find_attribute(primitive, weights);
    SHOAL_ASSIGN_OR_RETURN(auto joint_window, AttributeWindow::open(files, document, joint_accessor,
                                                                    place + "." + joints, 4, 4, vertex_count));
    SHOAL_ASSIGN_OR_RETURN(auto weight_window, AttributeWindow::open(files, document, weight_accessor,
                                                                     place + "." + weights, 4, 4, vertex_count));
    pose.joint_sets_.push_back({std::move(joint_window), std::move(weight_window)});
  }
  return pose;
}

void VertexPose::morph(AttributeWindow& position, AttributeWindow* normal, AttributeWindow* tangent) const {
  for (const Target& target : targets_) {
    if (target.position) add_scaled(position, *target.position, target.weight);
    if (normal != nullptr && target.normal) add_scaled(*normal, *target.normal, target.weight);
    if (tangent != nullptr && target.tangent) add_scaled(*tangent, *target.tangent, target.weight);
  }
}

/// The weighted sum of the joints' matrices. Weights are divided by their sum, which quantised ones miss by a little;
/// a vertex without any stays where it is.
Result<AffineDouble> VertexPose::blended(size_t vertex) const {
  AffineDouble sum;
  for (Vec3d& column : sum.column) column = {0, 0, 0};
  double total = 0;
  for (const JointSet& set : joint_sets_) {
    for (int k = 0; k < 4; ++k) {
      const double weight = set.weights.vertex(vertex)[k];
      if (weight == 0) continue;
      const float joint = set.joints.vertex(vertex)[k];
      if (!(joint >= 0 && joint < static_cast<float>(matrices_->size()))) {
        return Error{ErrorCode::kInput, fmt::format("{}: JOINTS: expected a joint below {}, found {}", place_,
                                                    matrices_->size(), joint)};
      }
      const std::array<double, 12>& m = (*matrices_)[static_cast<size_t>(joint)];
      for (size_t i = 0; i < 3; ++i) {
        for (size_t c = 0; c < 3; ++c) sum.column[c][i] += weight * m[3 * c + i];
        sum.translation[i] += weight * m[9 + i];
      }
      total += weight;
    }
  }
  if (total == 0) return AffineDouble{};
  for (size_t i = 0; i < 3; ++i) {
    for (Vec3d& column : sum.column) column[i] /= total;
    sum.translation[i] /= total;
  }
  return sum;
}

Status VertexPose::skin(AttributeWindow& position, AttributeWindow* normal, AttributeWindow* tangent,
                        std::vector<uint8_t>& turned) const {
  turned.resize(position.count());
  for (size_t i = 0; i < position.count(); ++i) {
    SHOAL_ASSIGN_OR_RETURN(const AffineDouble map, blended(i));
    float* v = position.vertex(i);
    const Vec3d p = map.point({v[0], v[1], v[2]});
    for (int c = 0; c < 3; ++c) v[c] = static_cast<float>(p[c]);
    turned[i] = determinant(map) < 0;
    if (normal != nullptr) move_direction(normal->vertex(i), cofactors(map), turned[i] ? -1 : 1);
    if (tangent != nullptr) move_direction(tangent->vertex(i), map, 1);
  }
  return {};
}

}  // namespace shoal
