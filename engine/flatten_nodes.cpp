#include "engine/flatten_nodes.h"

#include <fmt/format.h>

#include <algorithm>

#include "engine/math.h"

namespace shoal {

namespace {

constexpr double kPiDouble = 3.141592653589793238462643383279502884;
constexpr double kFloatMax = std::numeric_limits<float>::max();

AffineDouble node_matrix(const gltf::Node& node) {
  AffineDouble m;
  for (int i = 0; i < 3; ++i) m.column[i] = {node.matrix[4 * i], node.matrix[4 * i + 1], node.matrix[4 * i + 2]};
  m.translation = {node.matrix[12], node.matrix[13], node.matrix[14]};
  return m;
}

bool fits_float(const AffineDouble& m) { return finite(m) && finite(widened(rounded(m))); }

struct Visit {
  uint32_t node;
  AffineDouble parent_to_world;
};

void place(FlatScene& scene, const gltf::Node& node, const AffineDouble& to_world) {
  if (node.mesh) scene.meshes.push_back({*node.mesh, to_world});
  if (node.camera) scene.cameras.push_back({*node.camera, to_world});
  if (node.light) scene.lights.push_back({*node.light, to_world});
}

}  // namespace

Result<FlatScene> flatten_nodes(const gltf::Document& document, const gltf::Limits& limits) {
  FlatScene scene;
  std::vector<Visit> stack;
  for (auto root = document.roots.rbegin(); root != document.roots.rend(); ++root) stack.push_back({*root, {}});
  while (!stack.empty()) {
    const Visit visit = stack.back();
    stack.pop_back();
    const gltf::Node& node = document.nodes[visit.node];
    const AffineDouble to_world = multiply(visit.parent_to_world, node_matrix(node));
    if (fits_float(to_world)) {
      place(scene, node, to_world);
    } else if (node.mesh || node.camera || node.light) {
      scene.warnings.push_back(fmt::format("nodes[{}] is left out: its world matrix is not finite", visit.node));
    }
    if (scene.meshes.size() > limits.instances_count) {
      return Error{ErrorCode::kInput, fmt::format("{}: nodes with meshes: expected at most {}, found more",
                                                  document.path, limits.instances_count)};
    }
    for (auto c = node.children.rbegin(); c != node.children.rend(); ++c) stack.push_back({*c, to_world});
  }
  return scene;
}

float clamped_float(double value, double lo, double hi) {
  return static_cast<float>(value > lo ? std::min(value, hi) : lo);
}

std::vector<CameraRecord> convert_cameras(const gltf::Document& document, const FlatScene& scene) {
  std::vector<CameraRecord> records;
  for (const PlacedItem& item : scene.cameras) {
    const gltf::Camera& camera = document.cameras[item.index];
    CameraRecord record = {};
    record.camera_to_world = rounded(item.to_world);
    record.perspective = camera.perspective ? 1 : 0;
    // Just under half a turn keeps the tangent finite.
    const SinCos half = sin_cos(clamped_float(camera.yfov / 2, 1e-6, kPiDouble / 2 * 0.9999));
    record.tan_half_yfov = half.sin / half.cos;
    record.aspect_ratio = clamped_float(camera.aspect_ratio, 0, 1e6);
    record.xmag = clamped_float(camera.xmag, -kFloatMax, kFloatMax);
    record.ymag = clamped_float(camera.ymag, -kFloatMax, kFloatMax);
    records.push_back(record);
  }
  return records;
}

std::vector<PunctualLight> convert_lights(const gltf::Document& document, const FlatScene& scene) {
  std::vector<PunctualLight> lights;
  for (const PlacedItem& item : scene.lights) {
    const gltf::Light& light = document.lights[item.index];
    PunctualLight out = {};
    switch (light.type) {
      case gltf::LightType::kDirectional:
        out.type = PunctualType::kDirectional;
        break;
      case gltf::LightType::kPoint:
        out.type = PunctualType::kPoint;
        break;
      case gltf::LightType::kSpot:
        out.type = PunctualType::kSpot;
        break;
    }
    // The light goes along the node's -z axis (KHR_lights_punctual); a node squashed along z keeps the default.
    Vec3d way = normalized_or_zero(item.to_world.vector({0, 0, -1}));
    if (way == Vec3d{0, 0, 0}) way = {0, 0, -1};
    for (int i = 0; i < 3; ++i) {
      out.position[i] = static_cast<float>(item.to_world.translation[i]);
      out.direction[i] = static_cast<float>(way[i]);
      out.intensity[i] = clamped_float(light.color[i] * light.intensity, 0, kFloatMax);
    }
    out.cos_outer = sin_cos(clamped_float(light.outer_cone, 0, kPiDouble / 2)).cos;
    out.cos_inner = std::max(out.cos_outer, sin_cos(clamped_float(light.inner_cone, 0, kPiDouble / 2)).cos);
    lights.push_back(out);
  }
  return lights;
}

}  // namespace shoal
