// The rays that a path tracer makes, in the orders in which it makes them, and some that are harder. Made once, the
// same on every machine and whatever the number of threads, and given to every program alike. Called by
// bench/against_embree; cost: a depth-first trace or two of as many rays.
//
//   primary       through the scene's camera, a sample a pixel, tiles of 32 x 32 pixels
//   diffuse       cosine bounces from the primary hits, hit after hit
//   diffuse2      cosine bounces from the hits of those, hit after hit
//   shuffled      the diffuse rays in random order
//   scene-random  cosine rays from triangles picked at random over the whole scene
//   shadow        any hit, from the primary hits to points of emitters; without emitters into the open
#pragma once

#include <string>
#include <vector>

#include "bench/memory_orders.h"

namespace shoal::bench {

inline constexpr const char* kWorkloads[] = {"primary", "diffuse", "diffuse2", "shuffled", "scene-random", "shadow"};

class RayWorkloads {
 public:
  /// Keeps references to both. About `ray_count` rays a workload.
  RayWorkloads(const MemoryScene& scene, const WorldMesh& mesh, uint64_t ray_count, unsigned threads);

  /// Requires: one of kWorkloads. Fails with: kInput (a view that shows nothing, nothing to bounce from).
  Result<RaySet> make(const std::string& name);

 private:
  /// Kept, once they are known: rays with their hits.
  Result<const std::vector<Ray>*> primary_hits();
  Result<const std::vector<Ray>*> diffuse_hits();
  std::vector<Ray> hits_of(const LargeVector<BenchRay>& rays) const;

  LargeVector<BenchRay> primary_rays() const;
  LargeVector<BenchRay> bounces(const std::vector<Ray>& hits, uint32_t bounce) const;
  LargeVector<BenchRay> scene_random_rays() const;
  LargeVector<BenchRay> shadow_rays(const std::vector<Ray>& hits) const;

  const MemoryScene& scene_;
  const WorldMesh& mesh_;
  uint64_t ray_count_;
  unsigned threads_;
  std::vector<Ray> primary_hits_, diffuse_hits_;
};

}  // namespace shoal::bench
