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
  uint32_t sample : 29 = 0;
  uint32_t seeks : 2 = 0;           ///< AOVs: its next vertex is the first, or is seen in mirrors and glass only: PathSeeks
  uint32_t under_way : 1 = 0;       ///< begun, and not in the film
  uint32_t bounce = 0;              ///< 0: the camera ray's hit is shaded next
  uint32_t flags : 2 = 0;           ///< PathFlags: the render loop's, not the shader's
  uint32_t light_side : 30 = 0;     ///< LightReceiver::side of the vertex before, the shader's; of the camera nothing
  Vec3 throughput{1};
  float bsdf_pdf = 0;               ///< solid-angle density of `direction`; 0: camera (no MIS)
  Vec3 radiance{0};
  uint32_t next = kNoIndex;         ///< link among free paths, or among those that wait to be shaded
  Vec3 shadow_radiance{0};          ///< added to radiance when the shadow ray arrives unoccluded
  float t = 0;                      ///< of `hit`
  // The ray that goes on: origin and direction from its birth, hit and t when its traversal is done.
  Vec3 origin{0};
  std::atomic<uint32_t> pending{0};  ///< rays of this vertex still travelling
  Vec3 direction{0};
  uint32_t medium = 0;               ///< PathMedium: what volume the ray travels in
  Hit hit;
  uint32_t cone = 0;                 ///< pack_cone() of the ray; 0 without textures
};
static_assert(sizeof(PathState) == 116);

/// PathState::medium: the material of the volume + 1, or 0 in the open; the shader's.
enum PathMedium : uint32_t {
  kPathMediumMask = 0x7fffffffu,
  kPathOneWavelength = 0x80000000u,  ///< its throughput is that of one wavelength
};

/// PathState::seeks: what of the path AOVs have still to see.
enum PathSeeks : uint32_t {
  kSeeksNothing = 0,
  kSeeksSurface = 1,  ///< its first hit, and the albedo
  kSeeksAlbedo = 2,   ///< the albedo; its first hit is in the layers
};

enum PathFlags : uint32_t {
  kPathGoesOn = 1,   ///< the vertex sampled a bounce: its ray travels or has come home
  kPathCovered = 2,  ///< the camera ray hit something: counts for the film's alpha
};

}  // namespace shoal
