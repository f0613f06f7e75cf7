// Orders of tracing rays against a scene in memory, behind one small interface: the same rays in, the same answers
// out, and how long it took. Buffers are made once and kept from run to run, as a renderer keeps its own; filling
// them (sorting, queueing) is part of the time. One run at a time; its threads are its own.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "bench/memory_scene.h"
#include "bench/thread_team.h"
#include "engine/ray_group.h"

namespace shoal::bench {

/// A ray as every program is given it; each makes its own record of it, within the time.
struct BenchRay {
  Vec3 origin;
  float t;  ///< its end
  Vec3 direction;
  uint32_t reserved = 0;
};
static_assert(sizeof(BenchRay) == 32);

/// As every program hands it back. A ray that hits nothing keeps kRayInfinity; an any-hit ray that hits has 0.
struct RayAnswer {
  float t = kRayInfinity;
  uint32_t primitive = kNoIndex;  ///< in the program's own count
};

/// Rays that are traced together.
struct RaySet {
  std::string name;
  LargeVector<BenchRay> rays;
  bool any_hit = false;
  bool coherent = false;  ///< neighbours take nearly the same way
};

struct TraceCounts {
  uint64_t node_tests = 0, triangle_tests = 0, treelet_visits = 0;
  uint64_t drains = 0;  ///< of queues

  void add(const TraceCounts& other);
};

struct OrderRun {
  TeamSeconds seconds;
  TraceCounts counts;
};

class RayOrder {
 public:
  virtual ~RayOrder() = default;
  /// Requires: as many answers as rays, no more rays than the order was made for.
  virtual OrderRun run(const RaySet& set, std::span<RayAnswer> answers) = 0;
};

enum class MemoryOrder { kDepthFirst, kSorted, kQueued, kHybrid };
const char* name_of(MemoryOrder order);

enum class QueueChoice { kSweep, kFullest };  ///< which treelet a thread drains next

struct OrderOptions {
  unsigned threads = 1;
  uint64_t in_flight = 4u << 20;  ///< rays that wait in queues at once, at most
  QueueChoice choice = QueueChoice::kSweep;
};

/// Keeps a reference to `scene`.
std::unique_ptr<RayOrder> make_order(MemoryOrder order, const MemoryScene& scene, const OrderOptions& options,
                                     uint64_t ray_count);
std::unique_ptr<RayOrder> make_queued_order(const MemoryScene& scene, const OrderOptions& options, uint64_t ray_count);

/// Rays of one grab: threads share the rays out as they go.
inline constexpr uint64_t kRaysPerGrab = 1024;

inline Ray begin_ray(const BenchRay& start, uint32_t index, bool any_hit) {
  Ray ray;
  ray.origin = start.origin;
  ray.t = start.t;
  ray.direction = start.direction;
  ray.path = index | (any_hit ? Ray::kAnyHitBit : 0u);
  return ray;
}

inline RayAnswer answer_of(const Ray& ray) {
  if (!ray.hit.valid()) return {};
  return {ray.any_hit() ? 0 : ray.t, ray.hit.primitive};
}

/// One ray through every treelet on its way: to make rays from its hit, not to be timed.
void trace_to_end(const MemoryScene& scene, Ray& ray);

/// How fast these rays could go if everything they touch were in the core's own caches: rays a second of the second
/// pass over groups of consecutive rays, each group traced twice in a row: 64 rays depth-first, or 1024 by the hybrid
/// order's kernels, whichever is faster. Assumes that a group's nodes and leaves fit in L1 and L2; flatters a little,
/// since the branch predictors, too, have seen the group once. Groups are spread evenly over the rays. By CPU time
/// where `cpu_time`.
double bound_rays_per_second(const MemoryScene& scene, const RaySet& set, unsigned threads, bool cpu_time);

}  // namespace shoal::bench
