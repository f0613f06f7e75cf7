// Rays through a scene by every way that there is, on every instruction set that this processor and this build have:
// the queued and the depth-first orders' (TopTree::next and trace_treelets), the scalar reference's, and the hybrid
// order's (SceneTracer, single rays and packets). For tests of numerics, where all of them must agree to the bit.
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

/// The rays at their ends, by TopTree::next and `trace` (trace_treelet, trace_treelet_scalar): the depth-first way.
inline std::vector<Ray> trace_one_by_one(const TopTree& tree, const TestScene& scene, std::vector<Ray> rays,
                                         TraceFunction trace) {
  for (Ray& ray : rays) trace_scene(tree, scene.pages, ray, trace);
  return rays;
}

/// Traces `rays` every way on every instruction set and expects the same bits of all: of closest-hit rays the whole
/// ray, of any-hit rays whether they hit. Returns the rays at their ends.
inline std::vector<Ray> trace_every_way(const TestScene& scene, const std::vector<Ray>& rays) {
  const TopTree tree(scene.nodes, scene.entries, scene.instances);
  const std::vector<Ray> expected = trace_one_by_one(tree, scene, rays, trace_treelet_scalar);
  const auto compare = [&](const char* target, const char* way, const std::vector<Ray>& found) {
    for (size_t i = 0; i < rays.size(); ++i) {
      const bool same = rays[i].any_hit() ? expected[i].hit.valid() == found[i].hit.valid()
                                          : std::memcmp(&expected[i], &found[i], sizeof(Ray)) == 0;
      ASSERT_TRUE(same) << target << ", " << way << ": ray " << i << " ends at t " << found[i].t << " on primitive "
                        << static_cast<int64_t>(found[i].hit.valid() ? int64_t{found[i].hit.primitive} : -1)
                        << ", the scalar reference at t " << expected[i].t << " on "
                        << static_cast<int64_t>(expected[i].hit.valid() ? int64_t{expected[i].hit.primitive} : -1);
    }
  };
  on_every_instruction_set([&](const char* target) {
    compare(target, "treelet by treelet", trace_one_by_one(tree, scene, rays, trace_treelet));
    compare(target, "single rays", trace_together(tree, scene, rays, RayGrouping::kSingle));
    compare(target, "packets", trace_together(tree, scene, rays, RayGrouping::kPackets));
  });
  return expected;
}

}  // namespace shoal::testing
