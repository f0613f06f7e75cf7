// Random rays through the queues, the scheduler and the page cache, without paths and shading: the worst that a scene
// can be asked. A program of its own within bench/out_of_core.
//
// Origins lie on triangles picked at random over the whole scene, each as likely, directions are cosine-distributed
// about their normals, either side. They are made beforehand, from one pass over the file that is not counted; they
// come in random order. Rays end at their closest hit.
#pragma once

#include <cstdint>
#include <string>

#include "io/result.h"

namespace shoal::bench {

struct RandomRun {
  std::string scene, stats, policy = "resident-first";
  uint64_t rays = 0, in_flight = 0, page_cache_bytes = 0;
  uint32_t rays_ahead = 0;  ///< as of `shoal render`; 0: from the rays in flight
  unsigned threads = 0;
};

/// Traces them and writes counters and seconds as JSON. Fails with: kUsage (a scene with more than one instance).
Status trace_random_rays(const RandomRun& run);

}  // namespace shoal::bench
