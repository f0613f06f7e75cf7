// One triangle of a leaf against one ray: the order of hits and coverage, shared by all kernels, so that they accept the
// same hits to the bit; and the exact test for the scalar traversal.
#pragma once

#include <span>

#include "treelets/coverage_test.h"
#include "treelets/trace_treelet.h"
#include "treelets/treelet_view.h"
#include "treelets/triangle_test.h"

namespace shoal {

/// (t, instance, primitive) comes before the ray's hit so far.
inline bool comes_before(const Ray& ray, float t, uint32_t instance, uint32_t primitive) {
  if (t != ray.t) return t < ray.t;
  return instance != ray.hit.instance ? instance < ray.hit.instance : primitive < ray.hit.primitive;
}

/// Whether the triangle is there at the hit. Kept out of line: most leaves are opaque.
inline bool passes_coverage(const TreeletView& treelet, const Ray& ray, const TriangleHit& hit, uint32_t ordinal,
                            uint32_t primitive, TraceCounters& counters) {
  const uint32_t record = treelet.coverage_of()[ordinal];
  if (record == kNoIndex || !ray.has_coverage()) return true;
  ++counters.coverage_tests_count;
  return is_covered(treelet.coverage_records()[record], treelet.coverage_texels(), hit, ray.alpha_seed,
                    ray.instance, primitive);
}

/// What becomes of a hit on triangle `i` of the leaf at `offset`, at or before ray.t. Returns true when an any-hit ray is
/// done.
inline bool take_hit(const TreeletView& treelet, const LeafView& leaf, uint32_t offset, uint32_t i,
                     const TriangleHit& hit, Ray& ray, TreeletId id, TraceCounters& counters) {
  const bool any_hit = ray.any_hit();
  if (any_hit && !(hit.t < ray.t)) return false;
  const uint32_t primitive = leaf.primitive(i);
  if (!any_hit && !comes_before(ray, hit.t, ray.instance, primitive)) return false;
  if (leaf.has_coverage() &&
      !passes_coverage(treelet, ray, hit, leaf.header().first_ordinal + i, primitive, counters)) {
    return false;
  }
  ray.hit = {ray.instance, primitive, id, offset << 4 | i};
  if (any_hit) return true;
  ray.t = hit.t;
  return false;
}

/// Tests triangle `i` of the leaf at `offset`. Returns true when an any-hit ray is done.
template <TriangleTest kTest>
inline bool test_triangle(const TreeletView& treelet, const LeafView& leaf, uint32_t offset, uint32_t i,
                          const RaySpace& space, const TraceJob& job, TraceCounters& counters) {
  TriangleHit hit;
  return intersect_triangle<kTest>(space, leaf.position(i, 0), leaf.position(i, 1), leaf.position(i, 2), job.ray->t,
                                   hit) &&
         take_hit(treelet, leaf, offset, i, hit, *job.ray, job.entry.treelet, counters);
}

}  // namespace shoal
