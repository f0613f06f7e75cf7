// The triangles of a scene in memory as other answers to visibility take them (bench/kd_tree,
// bench/tiled_rasterizer): every triangle of every instance, with the numbers that a hit is named by. Made once;
// immutable, any number of threads.
//
// They give the answers of the BVH to the bit, because all decide by the project's own test of a ray and a triangle
// (treelets/triangle_test.h) in the instance's space, and take the smallest (t, instance, primitive). What is
// theirs is only which triangles are tested: those that they find must hold all that the test would accept.
#pragma once

#include "bench/large_vector.h"
#include "bench/memory_orders.h"
#include "treelets/ray_space.h"

namespace shoal::bench {

struct VisibleTriangle {
  Vec3 p[3];  ///< object space
  uint32_t instance, primitive;
};

struct VisibleTriangles {
  const TopTree* tree = nullptr;
  LargeVector<VisibleTriangle> triangles;
  Bounds3 bounds;       ///< world
  float pad_scale = 0;  ///< see pad()
  float pad_extent = 0;

  /// Corners in the world, rounded.
  void place(const VisibleTriangle& triangle, Vec3 world[3]) const;
  /// A hit that the test accepts for a ray from `origin` lies at most so far, along each axis, from the triangle in
  /// the world: twice the pads of treelets/ray_space.h, for the arithmetic of whoever asks.
  double pad(const Vec3& origin) const {
    return static_cast<double>(pad_scale) * (max_abs(&origin.x) + pad_extent);
  }
};

/// Fails with: kUsage (instances that move).
Result<VisibleTriangles> take_triangles(const MemoryScene& scene);

/// Tests one triangle against a ray, and keeps the hit if it comes first. `space`: the ray in the triangle's space.
void test_visible(const VisibleTriangle& triangle, const RaySpace& space, Ray& ray);

}  // namespace shoal::bench
