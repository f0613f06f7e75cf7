#include "engine/flatten_nodes.h"

#include <fmt/format.h>

#include <algorithm>

#include "engine/math.h"

namespace shoal {

namespace {

constexpr double kPiDouble = 3.141592653589793238462643383279502884;
constexpr double kFloatMax = std::numeric_limits<float>::max();

bool fits_float(const AffineDouble& m) { return finite(m) && finite(widened(rounded(m))); }

struct Visit {
  uint32_t node;
  AffineDouble parent_to_world;
};

void place(FlatScene& scene, const gltf::Document& document, uint32_t index, const AffineDouble& to_world) {
  const gltf::Node& node = document.nodes[index];
  const auto instancing = document.instancings.find(index);
  if (instancing != document.instancings.end()) {
    scene.meshes.insert(scene.meshes.end(), instancing->second.count, {*node.mesh, index, to_world});
  } else if (node.mesh) {
    scene.meshes.push_back({*node.mesh, kNoIndex, to_world, index});
  }
  if (node.camera) scene.cameras.push_back({*node.camera, kNoIndex, to_world, index});
  if (node.light) scene.lights.push_back({*node.light, kNoIndex, to_world});
}

uint64_t placed_meshes_of(const gltf::Document& document, uint32_t index) {
  const auto instancing = document.instancings.find(index);
  if (instancing != document.instancings.end()) return instancing->second.count;
  return document.nodes[index].mesh ? 1 : 0;
}

/// The places that a node's instances have below it, a run at a time.
class InstanceReader {
 public:
  static constexpr uint64_t kRun = 1024;

  static Result<InstanceReader> open(gltf::BufferFiles& files, const gltf::Document& document,
                                     const gltf::Instancing& instancing) {
    InstanceReader reader;
    const auto open_one = [&](std::optional<uint32_t> accessor, std::optional<gltf::AccessorReader>& out) -> Status {
      if (!accessor) return {};
      SHOAL_ASSIGN_OR_RETURN(out, gltf::AccessorReader::open(files, document, *accessor));
      return {};
    };
    SHOAL_RETURN_IF_ERROR(open_one(instancing.translation, reader.translation_));
    SHOAL_RETURN_IF_ERROR(open_one(instancing.rotation, reader.rotation_));
    SHOAL_RETURN_IF_ERROR(open_one(instancing.scale, reader.scale_));
    return reader;
  }

  Status read(uint64_t first, uint64_t count) {
    t_.assign(3 * count, 0), r_.assign(4 * count, 0), s_.assign(3 * count, 1);
    if (translation_) SHOAL_RETURN_IF_ERROR(translation_->read_floats(first, count, t_));
    if (rotation_) SHOAL_RETURN_IF_ERROR(rotation_->read_floats(first, count, r_));
    if (scale_) SHOAL_RETURN_IF_ERROR(scale_->read_floats(first, count, s_));
    return {};
  }

  /// Of the run that was read; not finite where the file says no place.
  AffineDouble place(uint64_t i) const {
    std::array<double, 4> q{0, 0, 0, 1};
    if (rotation_) q = {r_[4 * i], r_[4 * i + 1], r_[4 * i + 2], r_[4 * i + 3]};
    return affine_of(gltf::compose_matrix({t_[3 * i], t_[3 * i + 1], t_[3 * i + 2]}, q,
                                          {s_[3 * i], s_[3 * i + 1], s_[3 * i + 2]}));
  }

 private:
  std::optional<gltf::AccessorReader> translation_, rotation_, scale_;
  std::vector<float> t_, r_, s_;
};

}  // namespace

Result<FlatScene> flatten_nodes(const gltf::Document& document, const gltf::Limits& limits) {
  FlatScene scene;
  std::vector<Visit> stack;
  for (auto root = document.roots.rbegin(); root != document.roots.rend(); ++root) stack.push_back({*root, {}});
  while (!stack.empty()) {
    const Visit visit = stack.back();
    stack.pop_back();
    const gltf::Node& node = document.nodes[visit.node];
    const AffineDouble to_world = multiply(visit.parent_to_world, affine_of(node.matrix));
    if (fits_float(to_world)) {
      if (placed_meshes_of(document, visit.node) > limits.instances_count - scene.meshes.size()) {
        return Error{ErrorCode::kInput, fmt::format("{}: meshes that nodes show: expected at most {}, found more",
                                                    document.path, limits.instances_count)};
      }
      place(scene, document, visit.node, to_world);
    } else if (node.mesh || node.camera || node.light) {
      scene.warnings.push_back(fmt::format("nodes[{}] is left out: its world matrix is not finite", visit.node));
    }
    for (auto c = node.children.rbegin(); c != node.children.rend(); ++c) stack.push_back({*c, to_world});
  }
  return scene;
}

uint64_t count_placed_meshes(const gltf::Document& document) {
  uint64_t count = 0;
  std::vector<uint32_t> stack = document.roots;
  while (!stack.empty()) {
    const uint32_t node = stack.back();
    stack.pop_back();
    count += placed_meshes_of(document, node);  // cannot overflow: 2^24 nodes of 2^53 at most, far less in a file
    stack.insert(stack.end(), document.nodes[node].children.begin(), document.nodes[node].children.end());
  }
  return count;
}

Status place_instancings(gltf::BufferFiles& files, const gltf::Document& document, FlatScene& scene) {
  size_t kept = 0;
  for (size_t i = 0; i < scene.meshes.size();) {
    const uint32_t node = scene.meshes[i].instancing_node;
    if (node == kNoIndex) {
      scene.meshes[kept++] = scene.meshes[i++];
      continue;
    }
    const gltf::Instancing& instancing = document.instancings.at(node);
    SHOAL_ASSIGN_OR_RETURN(InstanceReader reader, InstanceReader::open(files, document, instancing));
    uint64_t left_out = 0;
    for (uint64_t first = 0; first < instancing.count; first += InstanceReader::kRun) {
      const uint64_t run = std::min(InstanceReader::kRun, instancing.count - first);
      SHOAL_RETURN_IF_ERROR(reader.read(first, run));
      for (uint64_t k = 0; k < run; ++k, ++i) {
        PlacedItem item = scene.meshes[i];
        item.to_world = multiply(item.to_world, reader.place(k));
        if (fits_float(item.to_world)) {
          scene.meshes[kept++] = item;
        } else {
          ++left_out;
        }
      }
    }
    if (left_out > 0) {
      scene.warnings.push_back(fmt::format("{} instances of nodes[{}] are left out: their matrices are not finite",
                                           left_out, node));
    }
  }
  scene.meshes.resize(kept);
  return {};
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
    out.range = light.range > 0 ? clamped_float(light.range, 1e-30, kFloatMax) : 0.0f;
    lights.push_back(out);
  }
  return lights;
}

}  // namespace shoal
