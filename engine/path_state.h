// What the integrator keeps of a path while its rays travel: touched at birth, when a vertex is shaded and when the
// path ends, never in traversal. Each path has at most one ray going on and one shadow ray.
//
// A vertex is shaded only after both rays of the vertex before have come home, so the order in which terms
// are added to `radiance` depends on the path alone: shadow of vertex k, emission of vertex k+1, and so on.
#pragma once

#include <atomic>
#include <cstdint>

#include "treelets/ray.h"

namespace shoal {

struct PathState {
  uint32_t pixel = 0;               ///< y * width + x in the film
  uint32_t sample = 0;
  uint32_t bounce = 0;              ///< 0: the camera ray's hit is shaded next
  uint32_t shaded_treelet = 0;      ///< for routing, not for shading
  Vec3 throughput{1};
  float bsdf_pdf = 0;               ///< solid-angle density of the direction of `ray`; 0: camera (no MIS)
  Vec3 radiance{0};
  float reserved0 = 0;
  Vec3 shadow_radiance{0};          ///< added to radiance when the shadow ray arrives unoccluded
  float reserved1 = 0;
  // The ray that goes on, as it came home: written when its traversal is done.
  Vec3 origin{0};
  float t = 0;
  Vec3 direction{0};
  uint32_t next = kNoIndex;         ///< link of intrusive lists (waiting to be shaded, free)
  Hit hit;
  std::atomic<uint32_t> pending{0}; ///< rays of this vertex still travelling
};

}  // namespace shoal
