// Lists of rays through an open scene, in any order that pictures are rendered in (engine/order_runner), by the very same
// loops, kernels and page cache, under the same memory cap; closest hits or any hit. Called by engine/ray_kinds and the
// library for other programs (api).
//
// Answers depend on scene, rays and TraceOptions::coverage; never on order, cap, threads or what was traced before.
//
// Properties and assumptions
//   memory     what the caller holds is part of the process: make the arrays of the largest list before the tracer, or
//              keep room for them (TraceOptions::kept_bytes). The cap cannot see them else.
//   pages      stay in the cache from list to list; paths in flight and queues are made anew where the order changes.
//   threads    trace() runs on its own threads; one call at a time.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "engine/query_ray.h"
#include "engine/render.h"

namespace shoal {

struct TraceOptions {
  /// Order, threads, cap and so on. Without effect: preview, time_limit_seconds, mapped_pages.
  ExecutionOptions execution;
  bool coverage = true;  ///< alpha MASK and BLEND cut holes (QueryRay::seed); false: every triangle is there
  bool points = false;   ///< closest hits have barycentrics: their treelet is asked for once more, as to shade it
  TriangleTest triangle_test = TriangleTest::kWatertight;
  uint64_t largest_list = 0;  ///< more rays than that will hardly come at once, so no more need be in flight; 0: unknown
  uint64_t kept_bytes = 0;    ///< of the cap, for the caller
};

/// Of one list.
struct TraceReport {
  RenderCounters counters;  ///< "samples" are rays; closest hits count as camera rays, any hits as shadow rays
  ChosenOrder order;
  double seconds = 0;
  PhaseTimes phases;            ///< of all threads: sums to threads * seconds
  uint64_t refused_count = 0;   ///< rays that no answer is defined for: answered as misses
  uint64_t peak_cache_bytes = 0;  ///< since the tracer was made
  uint64_t peak_process_bytes = 0;  ///< resident, of the whole process, since it began
};

class RayTracer {
 public:
  static constexpr uint64_t kMostRays = (uint64_t{1} << 32) - 1;  ///< of one list

  /// Plans the memory. The scene outlives the tracer.
  /// Fails with: kUsage (a policy that there is not), kMemoryCap (the message names the smallest that would work), kCorrupt.
  static Result<std::unique_ptr<RayTracer>> create(FileSystem& fs, const Scene& scene, const TraceOptions& options);
  ~RayTracer();

  /// Answers the rays [0, count) of the source. Requires: count <= kMostRays.
  /// hooks: as of a render, where "samples" are rays; `planned` and `recorder` are not looked at.
  /// Fails with: kInternal (counters do not balance), kCorrupt, kStorage, kMemoryCap, kStopped; not every ray is answered
  /// then, and after kCorrupt or kStorage every later list may fail.
  Result<TraceReport> trace(RaySource& rays, uint64_t count, RayQuery query, const RenderHooks& hooks = {});
  /// The same of arrays. Requires: as many hits as rays.
  Result<TraceReport> trace(std::span<const QueryRay> rays, RayQuery query, std::span<RayHit> hits,
                            const RenderHooks& hooks = {});

  const MemoryPlan& plan() const;
  unsigned threads() const;

 private:
  struct State;
  explicit RayTracer(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

struct TracedRays {
  std::vector<RayHit> hits;  ///< as many as rays
  TraceReport report;
  MemoryPlan plan;
};

/// One list, from a cold cache. Fails with: what RayTracer fails with.
Result<TracedRays> trace_rays(FileSystem& fs, const Scene& scene, std::span<const QueryRay> rays, RayQuery query,
                              const TraceOptions& options, const RenderHooks& hooks = {});

}  // namespace shoal
