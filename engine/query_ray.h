// Rays that are asked about one by one, apart from any picture, and their answers. Called by engine/trace_rays and who
// hands rays to it. Plain values.
#pragma once

#include <cstdint>
#include <span>

#include "treelets/ray.h"

namespace shoal {

/// origin + t * direction with t_min < t <= t_max (an any-hit query: t < t_max), in world space. The direction has any
/// length: t counts lengths of it. With t_min other than 0 the ray begins at origin + t_min * direction, rounded, so a
/// hit within that rounding of t_min may be on either side of it. Where t_max is not above t_min nothing is hit.
/// Origin, direction and t_min must be finite, the direction not zero, t_max not a NaN: else the ray is refused, which
/// is answered as a miss and counted (TraceReport::refused_count).
struct QueryRay {
  Vec3 origin{0};
  float t_min = 0;
  Vec3 direction{0};
  float t_max = kRayInfinity;  ///< infinity is as good
  /// Ray::alpha_seed. Upper half: when in the shutter, of scenes that move; kMiddle. Lower half: what alpha BLEND is
  /// decided by (all 32 bits are, of scenes that stand still): rays with one seed see the same triangles. With
  /// kEveryTriangle in it nothing is cut out, by MASK neither.
  uint32_t seed = kMiddle;

  static constexpr uint32_t kMiddle = 0x80000000u;
  static constexpr uint32_t kEveryTriangle = Ray::kNoCoverage;
};

enum class RayQuery : uint8_t {
  kClosest,  ///< the hit with the smallest (t, instance, primitive)
  kAny,      ///< whether there is one: the other fields of RayHit keep their defaults
};

struct RayHit {
  float t = 0;
  float u = 0, v = 0;            ///< barycentrics of the second and the third corner; 0 unless they were asked for
  uint32_t instance = kNoIndex;  ///< row of the .shoal's instances: 0 is all meshes that one node shows, then the others
  uint32_t object = 0;           ///< as AOV object_id has it, from 1 on (engine/object_ids.h); 0: no hit
  uint32_t primitive = kNoIndex; ///< of the source's triangles in order, degenerate ones counted
  bool hit = false;

  bool operator==(const RayHit&) const = default;
};

/// Where rays come from and answers go to: arrays of whatever layout their owner likes.
class RaySource {
 public:
  virtual ~RaySource() = default;
  /// Any thread; up to three times for a ray, with the same answer.
  virtual QueryRay ray(uint64_t index) const = 0;
  /// Once for each ray, by any thread.
  virtual void answer(uint64_t index, const RayHit& hit) = 0;
};

/// Two arrays, of as many elements each.
class RaySpans final : public RaySource {
 public:
  RaySpans(std::span<const QueryRay> rays, std::span<RayHit> hits) : rays_(rays), hits_(hits) {}
  QueryRay ray(uint64_t index) const override { return rays_[index]; }
  void answer(uint64_t index, const RayHit& hit) override { hits_[index] = hit; }

 private:
  std::span<const QueryRay> rays_;
  std::span<RayHit> hits_;
};

}  // namespace shoal
