// Scenes packed by hand for tests of traversal, carried through as an engine does, and the brute force that
// traversal is compared with. Header only, so that every test target may include it.
#pragma once

#include <vector>

#include "tests/support/hand_made_page.h"
#include "tests/support/test_meshes.h"
#include "treelets/leaf_test.h"
#include "treelets/ray_space.h"
#include "treelets/top_tree.h"
#include "treelets/trace_treelet.h"
#include "treelets/triangle_test.h"

namespace shoal::testing {

/// Objects, instances and their treelets.
struct TestScene {
  std::vector<TopNode> nodes;
  std::vector<TreeletEntry> entries;
  std::vector<Instance> instances;
  std::vector<AlignedPage> pages;
  std::vector<std::vector<TestTriangle>> objects;
};

struct TestSceneOptions {
  size_t treelet_triangles = 1000;  ///< about, a treelet
  size_t leaf_size = 4;
  bool reversed = false;  ///< pack the triangles the other way round
};

inline TopNode empty_top_node(uint32_t parent, uint32_t level) {
  TopNode node{};
  for (int axis = 0; axis < 3; ++axis) {
    for (int slot = 0; slot < 8; ++slot) {
      node.lo[axis][slot] = std::numeric_limits<float>::infinity();
      node.hi[axis][slot] = -std::numeric_limits<float>::infinity();
    }
  }
  node.parent = parent, node.level = level;
  return node;
}

inline void set_child(TopNode& node, uint32_t slot, ChildKind kind, uint32_t child, const Bounds3& b) {
  for (int axis = 0; axis < 3; ++axis) node.lo[axis][slot] = b.lo[axis], node.hi[axis][slot] = b.hi[axis];
  node.kind[slot] = kind, node.child[slot] = child;
}

/// Adds the tree of one object; returns its root.
inline uint32_t add_object_tree(TestScene& scene, std::span<TestTriangle> triangles, uint32_t parent,
                                uint32_t level, const TestSceneOptions& options) {
  const uint32_t index = static_cast<uint32_t>(scene.nodes.size());
  scene.nodes.push_back(empty_top_node(parent, level));
  const auto parts = split_in_eight(triangles, options.treelet_triangles);
  for (uint32_t slot = 0; slot < parts.size(); ++slot) {
    const Bounds3 b = bounds_of(parts[slot]);
    if (parts[slot].size() > options.treelet_triangles) {
      const uint32_t child = add_object_tree(scene, parts[slot], index << 3 | slot, level + 1, options);
      set_child(scene.nodes[index], slot, ChildKind::kNode, child, b);
      continue;
    }
    PagePacker packer(options.leaf_size);
    const NodeRef root = packer.add(parts[slot]);
    set_child(scene.nodes[index], slot, ChildKind::kEntry, static_cast<uint32_t>(scene.entries.size()), b);
    scene.entries.push_back({static_cast<TreeletId>(scene.pages.size()), root});
    scene.pages.emplace_back(packer.finish());
  }
  return index;
}

/// Where an object stands; the inverse is computed in double, rounded once.
struct Placement {
  uint32_t object = 0;
  Affine3 object_to_world;
};

inline Instance make_instance(const Placement& placement, uint32_t root, const Bounds3& object_bounds) {
  Instance instance{};
  instance.object_to_world = placement.object_to_world;
  instance.object = placement.object, instance.root_node = root;
  instance.max_abs_coordinate = max_abs_of(object_bounds);
  instance.identity = placement.object_to_world == Affine3{} ? 1 : 0;
  const Affine3& m = placement.object_to_world;
  const Vec3 columns[4] = {m.column_x, m.column_y, m.column_z, m.translation};
  double a[3][4], inverse[3][4];
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) a[r][c] = columns[c][r];
  }
  const double det = a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) -
                     a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) +
                     a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]);
  double error = 0;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      const int r1 = (c + 1) % 3, r2 = (c + 2) % 3, c1 = (r + 1) % 3, c2 = (r + 2) % 3;
      inverse[r][c] = (a[r1][c1] * a[r2][c2] - a[r1][c2] * a[r2][c1]) / det;
    }
    inverse[r][3] = -(inverse[r][0] * a[0][3] + inverse[r][1] * a[1][3] + inverse[r][2] * a[2][3]);
  }
  for (int r = 0; r < 3; ++r) {
    double sum = 0;
    for (int c = 0; c < 3; ++c) {
      for (int k = 0; k < 3; ++k) sum += std::abs(a[r][k]) * std::abs(inverse[k][c]);
    }
    error = std::max(error, sum);
  }
  Vec3* out[4] = {&instance.world_to_object.column_x, &instance.world_to_object.column_y,
                  &instance.world_to_object.column_z, &instance.world_to_object.translation};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) (*out[c])[r] = static_cast<float>(inverse[r][c]);
  }
  instance.transform_error = instance.identity ? 1.0f : static_cast<float>(error * 1.000001);
  return instance;
}

inline Bounds3 world_bounds(const Instance& instance, const Bounds3& b) {
  Bounds3 world;
  for (int corner = 0; corner < 8; ++corner) {
    world.include(instance.object_to_world.point(
        {corner & 1 ? b.hi.x : b.lo.x, corner & 2 ? b.hi.y : b.lo.y, corner & 4 ? b.hi.z : b.lo.z}));
  }
  return world;
}

/// The tree over instances [first, last) below node `index`.
inline void fill_instance_node(TestScene& scene, uint32_t index, uint32_t first, uint32_t last,
                               const std::vector<Bounds3>& bounds) {
  const uint32_t count = last - first;
  const uint32_t parts = std::min(count, 8u);
  for (uint32_t slot = 0; slot < parts; ++slot) {
    const uint32_t begin = first + count * slot / parts, end = first + count * (slot + 1) / parts;
    Bounds3 b;
    for (uint32_t i = begin; i < end; ++i) b.include(bounds[i]);
    if (end - begin == 1) {
      set_child(scene.nodes[index], slot, ChildKind::kInstance, begin, b);
      scene.instances[begin].tree_child = index << 3 | slot;
      continue;
    }
    const uint32_t child = static_cast<uint32_t>(scene.nodes.size());
    scene.nodes.push_back(empty_top_node(index << 3 | slot, scene.nodes[index].level + 1));
    set_child(scene.nodes[index], slot, ChildKind::kNode, child, b);
    fill_instance_node(scene, child, begin, end, bounds);
  }
}

inline TestScene make_scene(std::vector<std::vector<TestTriangle>> objects,
                            const std::vector<Placement>& placements, const TestSceneOptions& options = {}) {
  TestScene scene;
  scene.nodes.push_back(empty_top_node(kNoIndex, 0));
  std::vector<uint32_t> roots;
  std::vector<Bounds3> object_bounds;
  for (auto& object : objects) {
    std::vector<TestTriangle> packed = object;
    if (options.reversed) std::reverse(packed.begin(), packed.end());
    object_bounds.push_back(bounds_of(packed));
    roots.push_back(add_object_tree(scene, packed, kNoIndex, 0, options));
  }
  std::vector<Bounds3> bounds;
  for (const Placement& placement : placements) {
    scene.instances.push_back(make_instance(placement, roots[placement.object], object_bounds[placement.object]));
    bounds.push_back(world_bounds(scene.instances.back(), object_bounds[placement.object]));
  }
  fill_instance_node(scene, 0, 0, static_cast<uint32_t>(placements.size()), bounds);
  scene.objects = std::move(objects);
  return scene;
}

using TraceFunction = void (*)(std::span<const std::byte>, const TreeletEntry&, const Instance&, Ray&,
                               TraceCounters&, TriangleTest);

/// Carries one ray through the whole scene, as an engine does.
inline void trace_scene(const TopTree& tree, std::span<const AlignedPage> pages, Ray& ray, TraceFunction trace,
                        std::vector<uint32_t>* visited = nullptr) {
  TraceCounters counters;
  ray.cursor = ray.instance = kNoIndex, ray.more = 0;
  for (;;) {
    const uint32_t entry = tree.next(ray, counters.node_tests_count);
    if (entry == kNoIndex) return;
    if (visited) visited->push_back(entry);
    const TreeletEntry& e = tree.entry(entry);
    trace(pages[e.treelet].bytes(), e, tree.instance(ray.instance), ray, counters, TriangleTest::kWatertight);
    if (ray.any_hit() && ray.hit.valid()) return;
  }
}

/// Every triangle of every instance, with the same triangle test.
inline void brute_force(const TestScene& scene, Ray& ray, TriangleTest test = TriangleTest::kWatertight) {
  for (uint32_t i = 0; i < scene.instances.size(); ++i) {
    const RaySpace space = to_object_space(ray, scene.instances[i]);
    for (const TestTriangle& t : scene.objects[scene.instances[i].object]) {
      TriangleHit hit;
      if (!intersect_triangle(test, space, t.p[0], t.p[1], t.p[2], ray.t, hit)) continue;
      if (ray.any_hit() ? !(hit.t < ray.t) : !comes_before(ray, hit.t, i, t.primitive)) continue;
      ray.hit = {i, t.primitive, 0, 0};
      if (ray.any_hit()) return;
      ray.t = hit.t;
    }
  }
}

inline Ray make_ray(const Vec3& origin, const Vec3& direction, float t = kRayInfinity, bool any_hit = false) {
  Ray ray;
  ray.origin = origin, ray.direction = direction, ray.t = t;
  ray.path = any_hit ? Ray::kAnyHitBit : 0;
  return ray;
}

}  // namespace shoal::testing
