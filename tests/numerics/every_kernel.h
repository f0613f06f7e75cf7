// Rays through a scene by every way that there is, on every instruction set that this processor and this build have:
// the queued and the depth-first orders' (TopTree::next and trace_treelets), the scalar reference's, and the hybrid
// order's (SceneTracer, single rays and packets); and on the best of them those of treelets/scene_traversal.h. For tests of numerics, where all of them must agree to the bit.
#pragma once

#include <gtest/gtest.h>
#include <hwy/highway.h>

#include <cstdlib>
#include <cstring>
#include <vector>

#include "tests/support/ray_list_stream.h"
#include "treelets/trace_treelet_scalar.h"

namespace shoal::testing {

/// How many rays a test tries: `count`, in the long run (scripts/test --long) so many times more as SHOAL_NUMERICS_TIMES
/// says.
inline size_t rays_to_try(size_t count) {
  const char* times = std::getenv("SHOAL_NUMERICS_TIMES");
  const long long factor = times != nullptr ? std::atoll(times) : 1;
  return count * static_cast<size_t>(factor > 0 ? factor : 1);
}

/// `run(name)` for each instruction set, chosen while it runs.
template <class Run>
void on_every_instruction_set(const Run& run) {
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    run(hwy::TargetName(target));
    if (::testing::Test::HasFatalFailure()) break;
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

/// The rays at their ends, by TopTree::next and `trace(page, entry, instance, ray)`: the way of the depth-first order,
/// and with waits in between of the queued one.
template <class Trace>
std::vector<Ray> trace_one_by_one(const TopTree& tree, const TestScene& scene, std::vector<Ray> rays,
                                  const Trace& trace) {
  for (Ray& ray : rays) {
    uint64_t node_tests = 0;
    ray.cursor = ray.instance = kNoIndex, ray.more = 0;
    while (!(ray.any_hit() && ray.hit.valid())) {
      const uint32_t entry = tree.next(ray, node_tests);
      if (entry == kNoIndex) break;
      const TreeletEntry& e = tree.entry(entry);
      trace(scene.pages[e.treelet].bytes(), e, tree.instance(ray.instance), ray);
    }
    if (ray.any_hit()) ray.cursor = ray.instance = kNoIndex, ray.more = 0;
  }
  return rays;
}

inline int64_t primitive_or_none(const Ray& ray) { return ray.hit.valid() ? int64_t{ray.hit.primitive} : -1; }

/// The same bits of all: of closest-hit rays the whole ray, of any-hit rays whether they hit.
inline void expect_same_ends(const char* target, const char* way, const std::vector<Ray>& expected,
                             const std::vector<Ray>& found) {
  for (size_t i = 0; i < expected.size(); ++i) {
    const bool same = expected[i].any_hit() ? expected[i].hit.valid() == found[i].hit.valid()
                                            : std::memcmp(&expected[i], &found[i], sizeof(Ray)) == 0;
    ASSERT_TRUE(same) << target << ", " << way << ": ray " << i << " ends at t " << found[i].t << " on primitive "
                      << primitive_or_none(found[i]) << ", the scalar reference at t " << expected[i].t << " on "
                      << primitive_or_none(expected[i]);
  }
}

/// Traces `rays` every way on every instruction set and expects the same bits. Returns the rays at their ends.
inline std::vector<Ray> trace_every_way(const TestScene& scene, const std::vector<Ray>& rays,
                                        TriangleTest test = TriangleTest::kWatertight) {
  const TopTree tree(scene.nodes, scene.entries, scene.instances);
  TraceCounters counters;
  const auto scalar = [&](std::span<const std::byte> page, const TreeletEntry& entry, const Instance& instance,
                          Ray& ray) { trace_treelet_scalar(page, entry, instance, ray, counters, test); };
  const auto kernel = [&](std::span<const std::byte> page, const TreeletEntry& entry, const Instance& instance,
                          Ray& ray) { trace_treelet(page, entry, instance, ray, counters, test); };
  const std::vector<Ray> expected = trace_one_by_one(tree, scene, rays, scalar);
  on_every_instruction_set([&](const char* target) {
    expect_same_ends(target, "treelet by treelet", expected, trace_one_by_one(tree, scene, rays, kernel));
    expect_same_ends(target, "single rays", expected, trace_together(tree, scene, rays, RayGrouping::kSingle, test));
    expect_same_ends(target, "packets", expected, trace_together(tree, scene, rays, RayGrouping::kPackets, test));
  });
  for (const TraversalWay& way : kTraversalWays) {  // scene_traversal_test has them on every instruction set
    expect_same_ends("the best", way.name, expected, trace_by(way, tree, scene, rays, counters, test));
  }
  return expected;
}

}  // namespace shoal::testing
