#include "treelets/ray_space.h"
#include "treelets/trace_treelet.h"
#include "treelets/treelet_view.h"
#include "treelets/triangle_test.h"

namespace shoal {

TreeletTriangle find_triangle(std::span<const std::byte> page, uint32_t slot) {
  const TreeletView treelet(page);
  const LeafView leaf = treelet.leaf(slot >> 4);
  const uint32_t i = slot & 15;
  TreeletTriangle triangle;
  triangle.p0 = leaf.position(i, 0);
  triangle.p1 = leaf.position(i, 1);
  triangle.p2 = leaf.position(i, 2);
  triangle.ordinal = leaf.header().first_ordinal + i;
  triangle.primitive = leaf.primitive(i);
  triangle.material = treelet.header->uniform_material;
  return triangle;
}

TrianglePoint intersect_known(const Ray& ray, const Instance& instance, const TreeletTriangle& triangle,
                              TriangleTest test) {
  const RaySpace space = to_object_space(ray, instance);
  TriangleHit hit{0, 0, 0};
  // A ray that misses after all (not the one that hit) still gets a point of the triangle.
  intersect_triangle(test, space, triangle.p0, triangle.p1, triangle.p2, kRayInfinity, hit);
  return {hit.t, hit.b1, hit.b2};
}

}  // namespace shoal
