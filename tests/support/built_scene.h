// Scenes built by the product's builder, kept in memory, for tests and benchmarks of traversal. Header only.
#pragma once

#include "tests/support/hand_made_scene.h"
#include "treelets/build_object.h"

namespace shoal::testing {

class PageSink : public TreeletSink {
 public:
  explicit PageSink(std::vector<AlignedPage>& pages) : pages_(pages) {}
  Result<TreeletId> add(std::span<const std::byte> geometry, std::span<const std::byte>) override {
    pages_.emplace_back(geometry);
    return static_cast<TreeletId>(pages_.size() - 1);
  }

 private:
  std::vector<AlignedPage>& pages_;
};

/// Appends a built object's nodes and entries; returns its root.
inline uint32_t append_object(TestScene& scene, const BuiltObject& object) {
  const uint32_t base = static_cast<uint32_t>(scene.nodes.size());
  const uint32_t first_entry = static_cast<uint32_t>(scene.entries.size());
  for (TopNode node : object.nodes) {
    if (node.parent != kNoIndex) node.parent += base << 3;
    for (int slot = 0; slot < 8; ++slot) {
      if (node.kind[slot] == ChildKind::kNode) node.child[slot] += base;
      if (node.kind[slot] == ChildKind::kEntry) node.child[slot] += first_entry;
    }
    scene.nodes.push_back(node);
  }
  scene.entries.insert(scene.entries.end(), object.entries.begin(), object.entries.end());
  return base;
}

/// `position_step`: TriangleSoup's. `coverage`: of material 0, which all triangles have.
inline TestScene build_scene(std::vector<std::vector<TestTriangle>> objects,
                             const std::vector<Placement>& placements, uint32_t treelet_bytes,
                             float position_step = 0, const CoverageSource* coverage = nullptr) {
  TestScene scene;
  std::vector<BuiltObject> built;
  PageSink sink(scene.pages);
  for (const auto& object : objects) {
    TriangleSoup soup;
    soup.position_step = position_step;
    for (const TestTriangle& t : object) {
      for (const Vec3& p : t.p) soup.positions.insert(soup.positions.end(), {p.x, p.y, p.z});
      soup.primitive.push_back(t.primitive);
      soup.material.push_back(0);
    }
    built.push_back(build_object(std::move(soup), {treelet_bytes}, coverage, sink).value());
  }
  std::vector<InstanceBounds> bounds;
  for (const Placement& placement : placements) {
    const Bounds3& b = built[placement.object].bounds;
    scene.instances.push_back(make_instance(placement, 0, b));
    bounds.push_back({static_cast<uint32_t>(bounds.size()), world_bounds(scene.instances.back(), b)});
  }
  scene.nodes = build_instance_tree(bounds);
  for (uint32_t node = 0; node < scene.nodes.size(); ++node) {
    for (uint32_t slot = 0; slot < 8; ++slot) {
      if (scene.nodes[node].kind[slot] != ChildKind::kInstance) continue;
      scene.instances[scene.nodes[node].child[slot]].tree_child = node << 3 | slot;
    }
  }
  std::vector<uint32_t> roots;
  for (const BuiltObject& object : built) roots.push_back(append_object(scene, object));
  for (size_t i = 0; i < placements.size(); ++i) scene.instances[i].root_node = roots[placements[i].object];
  scene.objects = std::move(objects);
  return scene;
}

}  // namespace shoal::testing
