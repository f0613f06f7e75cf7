#include "engine/plan_objects.h"

#include <fmt/format.h>

#include <algorithm>

#include "engine/vertex_pose.h"

namespace shoal {

namespace {

constexpr uint64_t kMaxTriangles = 0xfffffffeu;  // ids below kNoIndex

bool draws_triangles(const gltf::Primitive& primitive) {
  return primitive.mode == gltf::PrimitiveMode::kTriangles ||
         primitive.mode == gltf::PrimitiveMode::kTriangleStrip ||
         primitive.mode == gltf::PrimitiveMode::kTriangleFan;
}

void note_material(const gltf::Document& document, const gltf::Primitive& primitive,
                   std::vector<MaterialUse>& uses) {
  MaterialUse& use = primitive.material ? uses[*primitive.material] : uses.back();
  use.used = true;
  const auto color = primitive.attributes.find("COLOR_0");
  if (color == primitive.attributes.end()) return;
  use.vertex_colors = true;
  if (document.accessors[color->second].components == 4) use.vertex_alpha = true;
}

void group_objects(GeometryPlan& plan) {
  ObjectPlan world;
  world.baked = true;
  std::vector<ObjectPlan> shared;
  for (uint32_t m = 0; m < plan.meshes.size(); ++m) {
    const MeshPlan& mesh = plan.meshes[m];
    if (mesh.primitives.empty()) continue;
    if (mesh.placements.size() == 1 && !mesh.moves) {
      world.meshes.push_back(m);
    } else {
      shared.push_back({{m}, false});
    }
  }
  if (!world.meshes.empty()) plan.objects.push_back(std::move(world));
  for (ObjectPlan& object : shared) plan.objects.push_back(std::move(object));
}

}  // namespace

Result<GeometryPlan> plan_geometry(gltf::BufferFiles* files, const gltf::Document& document,
                                   const FlatScene& scene) {
  GeometryPlan plan;
  plan.meshes.resize(document.meshes.size());
  plan.uses.resize(document.materials.size() + 1);
  for (uint32_t i = 0; i < scene.meshes.size(); ++i) {
    MeshPlan& mesh = plan.meshes[scene.meshes[i].index];
    mesh.placements.push_back(i);
    mesh.moves = mesh.moves || scene.meshes[i].moves;
  }
  uint64_t triangles = 0, others = 0;
  for (uint32_t m = 0; m < document.meshes.size(); ++m) {
    if (plan.meshes[m].placements.empty()) continue;
    const gltf::Mesh& mesh = document.meshes[m];
    for (uint32_t p = 0; p < mesh.primitives.size(); ++p) {
      const gltf::Primitive& primitive = mesh.primitives[p];
      if (!draws_triangles(primitive)) {
        ++others;
        continue;
      }
      SHOAL_ASSIGN_OR_RETURN(const auto stream, files ? gltf::TriangleStream::open(*files, document, primitive)
                                                      : gltf::TriangleStream::describe(document, primitive));
      if (stream.count() == 0) continue;
      if (stream.count() > kMaxTriangles - triangles) {
        return Error{
            ErrorCode::kInput,
            fmt::format("{}: meshes[{}].primitives[{}]: expected at most {} triangles in the scene, found more",
                        document.path, m, p, kMaxTriangles)};
      }
      plan.meshes[m].primitives.push_back({m, p, stream.count(), static_cast<uint32_t>(triangles)});
      triangles += stream.count();
      note_material(document, primitive, plan.uses);
    }
  }
  if (others > 0) {
    plan.warnings.push_back(
        fmt::format("{} primitives of points or lines are left out: only triangles are drawn", others));
  }
  group_objects(plan);
  return plan;
}

CornerLayout object_layout(const gltf::Document& document, const GeometryPlan& geometry, const ObjectPlan& object,
                           const MaterialPlan& materials) {
  CornerLayout layout;
  for (const uint32_t mesh : object.meshes) {
    for (const PrimitiveSource& source : geometry.meshes[mesh].primitives) {
      layout = united(layout, layout_of(document.meshes[mesh].primitives[source.primitive], materials));
    }
  }
  return layout;
}

uint32_t most_pose_windows(const gltf::Document& document, const GeometryPlan& geometry) {
  uint32_t most = 0;
  for (const MeshPlan& plan : geometry.meshes) {
    for (const PrimitiveSource& source : plan.primitives) {
      const gltf::Mesh& mesh = document.meshes[source.mesh];
      most = std::max(most, VertexPose::window_count(mesh, mesh.primitives[source.primitive]));
    }
  }
  return most;
}

uint64_t object_triangles(const GeometryPlan& geometry, const ObjectPlan& object) {
  uint64_t count = 0;
  for (const uint32_t mesh : object.meshes) {
    for (const PrimitiveSource& source : geometry.meshes[mesh].primitives) count += source.triangle_count;
  }
  return count;
}

}  // namespace shoal
