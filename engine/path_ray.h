// The rays of a path, and what a ray's `path` word says: bit 31 any hit, bits 26..30 the bounce (for the counters;
// later bounces share the last value), bits 0..25 the path's index. Called by engine/render_*.
#pragma once

#include "engine/counters.h"
#include "engine/path_state.h"
#include "engine/sampler.h"
#include "treelets/ray.h"

namespace shoal {

inline constexpr uint32_t kPathIndexBits = 26;
inline constexpr uint32_t kMaxPathsInFlight = 1u << kPathIndexBits;

inline uint32_t path_index_of(const Ray& ray) { return ray.path & (kMaxPathsInFlight - 1); }
inline uint32_t counted_bounce_of(const Ray& ray) { return (ray.path >> kPathIndexBits) & (kCountedBounces - 1); }
inline RayKind kind_of(const Ray& ray) {
  if (ray.any_hit()) return RayKind::kShadow;
  return counted_bounce_of(ray) == 0 ? RayKind::kCamera : RayKind::kBounce;
}

/// What a ray's coverage is decided by. Never Ray::kNoCoverage.
inline uint32_t coverage_seed(const PathState& path, uint64_t seed, bool any_hit) {
  const uint32_t bits = random4(seed, path.pixel, path.sample, path.bounce, Dimension::kCoverage).bits[any_hit ? 1 : 0];
  return bits == Ray::kNoCoverage ? 0 : bits;
}

/// A ray of `path`, not yet addressed. `bounce` is the vertex that it leaves from (shadow) or goes to. Without
/// `coverage` every triangle is there.
inline Ray make_ray(uint32_t path_index, const PathState& path, uint64_t seed, const Vec3& origin,
                    const Vec3& direction, float t_max, bool any_hit, bool coverage) {
  Ray ray;
  ray.origin = origin;
  ray.direction = direction;
  ray.t = t_max;
  const uint32_t counted = path.bounce < kCountedBounces ? path.bounce : kCountedBounces - 1;
  ray.path = path_index | (counted << kPathIndexBits) | (any_hit ? Ray::kAnyHitBit : 0u);
  ray.alpha_seed = coverage ? coverage_seed(path, seed, any_hit) : Ray::kNoCoverage;
  return ray;
}

}  // namespace shoal
