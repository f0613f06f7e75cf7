#include "bench/visible_triangles.h"

#include "treelets/leaf_test.h"

namespace shoal::bench {
namespace {

void append(const TreeletView& view, uint32_t instance, VisibleTriangles& out) {
  for (uint32_t offset = 0; offset < view.header->leaves_bytes;) {
    const LeafView leaf = view.leaf(offset / 4);
    for (uint32_t i = 0; i < leaf.triangle_count; ++i) {
      out.triangles.push_back(
          {{leaf.position(i, 0), leaf.position(i, 1), leaf.position(i, 2)}, instance, leaf.primitive(i)});
    }
    offset += leaf.bytes();
  }
}

}  // namespace

void VisibleTriangles::place(const VisibleTriangle& triangle, Vec3 world[3]) const {
  const Instance& instance = tree->instance(triangle.instance);
  for (int corner = 0; corner < 3; ++corner) {
    world[corner] =
        instance.identity != 0 ? triangle.p[corner] : instance.object_to_world.point(triangle.p[corner]);
  }
}

Result<VisibleTriangles> take_triangles(const MemoryScene& scene) {
  VisibleTriangles out;
  out.tree = &scene.top_tree();
  out.triangles.reserve(scene.scene.header.instanced_triangles_count);
  bool all_identity = true;
  for (uint32_t index = 0; index < out.tree->instance_count(); ++index) {
    const Instance& instance = out.tree->instance(index);
    if (instance.moves()) return Error{ErrorCode::kUsage, "instances that move are not looked for here"};
    const Affine3& m = instance.object_to_world;
    float row_sum = 0;
    for (int axis = 0; axis < 3; ++axis) {
      row_sum =
          std::max(row_sum, std::abs(m.column_x[axis]) + std::abs(m.column_y[axis]) + std::abs(m.column_z[axis]));
    }
    all_identity = all_identity && instance.identity != 0;
    out.pad_scale = std::max(out.pad_scale, 2 * kWorldPad * instance.transform_error);
    out.pad_extent = std::max(out.pad_extent, max_abs(&m.translation.x) + row_sum * instance.max_abs_coordinate);
    for (const TreeletId id : treelets_below(*out.tree, instance.root_node)) {
      append(TreeletView(scene.pages[id]), index, out);
    }
  }
  if (all_identity) out.pad_scale = 2 * kObjectPad;
  for (const VisibleTriangle& triangle : out.triangles) {
    Vec3 world[3];
    out.place(triangle, world);
    for (const Vec3& p : world) out.bounds.include(p);
  }
  return out;
}

void test_visible(const VisibleTriangle& triangle, const RaySpace& space, Ray& ray) {
  TriangleHit hit;
  if (!intersect_triangle(space, triangle.p[0], triangle.p[1], triangle.p[2], ray.t, hit)) return;
  if (!comes_before(ray, hit.t, triangle.instance, triangle.primitive)) return;
  ray.hit.instance = triangle.instance, ray.hit.primitive = triangle.primitive;
  ray.t = hit.t;
}

}  // namespace shoal::bench
