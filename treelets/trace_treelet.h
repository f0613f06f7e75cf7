// Rays through treelets, each completely: every triangle below an entry's root that could be hit is tested. Returns
// nothing about where a ray goes next; TopTree::next says that, and the engine routes.
// Called by engine/render_*. Pure: reads the pages, writes the rays. Any number of threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "io/result.h"
#include "treelets/ray.h"
#include "treelets/top_tree.h"
#include "treelets/triangle_test_kind.h"

namespace shoal {

struct TraceCounters {
  uint64_t node_tests_count = 0;  ///< 8-wide nodes tested, in treelets and top tree
  uint64_t triangle_tests_count = 0;
  uint64_t coverage_tests_count = 0;
  /// Of traversals in lock-step: lanes that their steps offered, and lanes of those that had something to do.
  uint64_t simd_lanes_count = 0, simd_active_lanes_count = 0;
};

/// In which turn rays that are traced together take their steps (treelets/inner_loops.h); the same hits whichever.
enum class InnerLoop : uint8_t { kMoreNumerous, kWhileWhile, kIfIf };

/// One ray at one treelet.
struct TraceJob {
  const std::byte* page;  ///< the decoded geometry page
  Ray* ray;
  RayContext* context;       ///< of this ray, kept while a worker has it in hand (treelets/ray_space.h)
  const Instance* instance;  ///< the one that ray->instance names
  TreeletEntry entry;
  uint32_t node_tests = 0, triangle_tests = 0;  ///< of this job, counted up
};

/// Crosses each job's treelet from `entry.root`. Rays are traced several at once, each step of one while the others
/// wait for memory: many jobs in one call are faster than one in many calls. Rays do not affect each other; the jobs
/// may be of one treelet or of many.
/// Closest hit: ray.t and ray.hit become the smallest (t, instance, primitive) so far.
/// Any hit: on the first covered triangle with t < ray.t, ray.hit.instance is set and it returns at once.
/// Requires: the page passed check_treelet(), entry.root passed check_root(), at least 64 readable bytes follow the
/// page (as in PagePin::bytes). Adds the jobs' tests to `counters`.
void trace_treelets(std::span<TraceJob> jobs, TraceCounters& counters, TriangleTest test = TriangleTest::kWatertight,
                    InnerLoop loop = InnerLoop::kMoreNumerous);
/// One ray. `instance` is the one that ray.instance names.
void trace_treelet(std::span<const std::byte> page, const TreeletEntry& entry, const Instance& instance, Ray& ray,
                   TraceCounters& counters, TriangleTest test = TriangleTest::kWatertight);
/// The same for a worker that keeps `context` while it has this ray in hand (treelets/ray_space.h).
void trace_treelet(std::span<const std::byte> page, const TreeletEntry& entry, const Instance& instance, Ray& ray,
                   RayContext& context, TraceCounters& counters, TriangleTest test = TriangleTest::kWatertight);

/// Checks every offset and count of a geometry page from a file, so that trace_treelet and find_triangle cannot
/// read outside it or loop. Run once when a page is decoded. Fails with: kCorrupt.
Status check_treelet(std::span<const std::byte> page);
/// Checks that a TreeletEntry's root lies in the page. Requires: the page passed check_treelet(). Fails with:
/// kCorrupt.
Status check_root(std::span<const std::byte> page, uint32_t root);

/// One triangle of a treelet by Hit::slot, for shading.
struct TreeletTriangle {
  Vec3 p0, p1, p2;  ///< object space
  uint32_t primitive;
  uint32_t ordinal;   ///< index of the triangle in the treelet; indexes the attribute page
  uint32_t material;  ///< of the page when uniform, else kNoIndex: see the attribute page
};
/// Requires: slot comes from a hit in this page.
TreeletTriangle find_triangle(std::span<const std::byte> page, uint32_t slot);

/// Where a ray meets a triangle that it is known to hit: barycentrics of p1 and p2 by the same arithmetic as
/// traversal, if `test` is what traversal tests by.
struct TrianglePoint {
  float t, b1, b2;
};
TrianglePoint intersect_known(const Ray& ray, const Instance& instance, const TreeletTriangle& triangle,
                              TriangleTest test = TriangleTest::kWatertight);

/// Attributes of one triangle's corners from an attribute page. Missing ones have their defaults:
/// normal and tangent zero, colour one, uv zero.
struct CornerAttributes {
  Vec3 normal{0};
  Vec4 tangent{0};
  Vec4 color{1};
  Vec2 uv[4] = {};
};
struct TriangleAttributes {
  uint32_t material = 0;
  CornerAttributes corner[3];
};
/// Fails with: kCorrupt when the page is not well formed; run once when decoded.
Status check_attributes(std::span<const std::byte> page);
/// Requires: a checked page, ordinal < its triangle count.
TriangleAttributes find_attributes(std::span<const std::byte> page, uint32_t ordinal);

}  // namespace shoal
