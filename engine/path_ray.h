// The rays of a path, and what a ray's `path` word says: bit 31 any hit, bits 26..30 the bounce (for the counters;
// later bounces share the last value), bits 0..25 the path's index. Called by engine/render_*.
#pragma once

#include "engine/counters.h"
#include "engine/path_state.h"
#include "engine/sampler.h"
#include "engine/shutter_times.h"
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

/// What a ray's coverage is decided by. Ray::has_coverage() is true of it.
inline uint32_t coverage_seed(const PathState& path, const Sampler& sampler, bool any_hit) {
  const uint32_t bits = sampler.hash(path.pixel, path.sample, path.bounce, Dimension::kCoverage).bits[any_hit ? 1 : 0];
  return (bits & 0xffffu) == Ray::kNoCoverage ? bits ^ 1 : bits;
}

/// What the rays of a picture carry beside their way: without `coverage` every triangle is there.
struct RaySeeds {
  const Sampler& sampler;
  bool coverage = true;
  ShutterTimes times = ShutterTimes::kNone;

  uint32_t of(const PathState& path, bool any_hit) const {
    const uint32_t bits = coverage ? coverage_seed(path, sampler, any_hit) : Ray::kNoCoverage;
    if (times == ShutterTimes::kNone) return bits;
    return (time_bits(path, sampler, times) & 0xffff0000u) | (bits & 0xffffu);
  }
};

/// A ray of `path`, not yet addressed; `path.bounce` is the vertex that it leaves from (shadow) or goes to.
inline Ray make_ray(uint32_t path_index, const PathState& path, const RaySeeds& seeds, const Vec3& origin,
                    const Vec3& direction, float t_max, bool any_hit) {
  Ray ray;
  ray.origin = origin;
  ray.direction = direction;
  ray.t = t_max;
  const uint32_t counted = path.bounce < kCountedBounces ? path.bounce : kCountedBounces - 1;
  ray.path = path_index | (counted << kPathIndexBits) | (any_hit ? Ray::kAnyHitBit : 0u);
  ray.alpha_seed = seeds.of(path, any_hit);
  return ray;
}

}  // namespace shoal
