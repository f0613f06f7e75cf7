// Rays and hits: plain values without padding that matters, in arrays of the caller's.
//
// Space is the world of the scene: metres where the glTF keeps to its own rule, +y up. The ray is the points
// origin + t * direction. The direction has any length but zero; t counts lengths of it, so with a unit direction t is a
// distance.
#pragma once

#include <cstdint>
#include <limits>

namespace shoal::api {

inline constexpr uint32_t kNone = 0xffffffffu;

struct Ray {
  float origin[3] = {0, 0, 0};
  /// Hits are at t_min < t <= t_max (Query::kAny: t < t_max). With t_min other than 0 the ray begins at
  /// origin + t_min * direction, rounded to float, so that a hit closer to t_min than that rounding may be on either side.
  float t_min = 0;
  float direction[3] = {0, 0, 1};
  float t_max = std::numeric_limits<float>::infinity();
  /// When, of scenes built with a shutter (`shoal build --shutter`): 0 when it opens, 1 when it closes; in steps of
  /// 2^-16. Other scenes do not look at it.
  float time = 0.5f;
  /// What alpha BLEND is decided by: a triangle with alpha a is there for a share a of all seeds, and rays with one seed
  /// see the same triangles. In scenes with a shutter only the lower 16 bits count.
  uint32_t seed = 0;
};

/// The first hit of a ray, or none.
struct Hit {
  float t = 0;
  /// Barycentrics of the triangle's second and third corner: point = (1 - u - v) p0 + u p1 + v p2. 0 without
  /// TracerOptions::barycentrics.
  float u = 0, v = 0;
  uint32_t instance = kNone;   ///< 0: the meshes that one node of the source shows, all together; then an instance each
  uint32_t object = 0;         ///< every mesh that a node shows has a number, from 1 on (AOV object_id of `shoal render`)
  uint32_t primitive = kNone;  ///< place among all triangles of the source, degenerate ones counted
  bool hit = false;            ///< of Query::kAny the only field that is set
};

enum class Query : uint8_t {
  kClosest,  ///< the hit with the smallest t; of equal ones that of the smallest (instance, primitive)
  kAny,      ///< whether there is a hit at all: cheaper, for shadows and visibility
};

}  // namespace shoal::api
