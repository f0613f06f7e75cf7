// The counters of a render: one list (name, unit, sentence) makes the struct, the sum and the JSON. Plain integers, one
// set a thread, always on, added once a batch or a vertex; summed when the render ends, then checked
// (check_identities). Called by engine/render_* and engine/render_report.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "engine/invalid_samples.h"
#include "io/result.h"

namespace shoal {

// X(name, unit, sentence)
#define SHOAL_RENDER_COUNTERS(X)                                                                              \
  X(samples_started_count, "samples", "camera paths begun")                                                   \
  X(samples_committed_count, "samples", "paths added to the film")                                            \
  X(page_requests_count, "pages", "pages asked of the page cache")                                            \
  X(page_hits_count, "pages", "asked and resident, or being read by another thread already")                  \
  X(page_misses_count, "pages", "asked and read from disk")                                                   \
  X(page_prefetches_count, "pages", "read ahead from disk, before anyone asked")                              \
  X(page_evictions_count, "pages", "pages dropped to make room")                                              \
  X(disk_reads_count, "reads", "read requests to the disk")                                                   \
  X(disk_read_bytes, "bytes", "bytes asked of the disk")                                                      \
  X(decoded_bytes, "bytes", "bytes of pages after decompression")                                             \
  X(treelet_loads_count, "pages", "treelet geometry pages read")                                              \
  X(treelet_load_bytes, "bytes", "bytes of those, decoded")                                                   \
  X(attribute_loads_count, "pages", "attribute pages read")                                                   \
  X(texture_loads_count, "pages", "texture tiles read")                                                       \
  X(treelet_visits_count, "visits", "a ray crossing a treelet")                                               \
  X(treelet_batches_count, "batches", "a treelet taken in hand for the rays that wait for it")                \
  X(treelet_visit_bytes, "bytes", "sizes of the treelets taken in hand, summed: bytes into the cache at most") \
  X(paths_shaded_waiting_count, "paths", "vertices that waited for their treelet before shading")             \
  X(ray_moved_bytes, "bytes", "bytes of rays written to and read from queues")                                \
  X(path_state_moved_bytes, "bytes",                                                                          \
    "bytes of path states touched: at birth, at the end of each ray, at shading and at the end")              \
  X(vertices_shaded_count, "vertices", "path vertices shaded")                                                \
  X(texture_lookups_count, "lookups", "texture look-ups")                                                     \
  X(texture_tiles_pinned_count, "tiles", "changes from a texture tile to another, a thread at a time")         \
  X(coverage_tests_count, "tests", "alpha coverage tests in traversal")                                       \
  X(simd_lanes_count, "lanes", "lanes offered by tests in lock-step (docs/measuring.md says of which orders)")  \
  X(simd_active_lanes_count, "lanes", "of those, lanes that had something to do")                             \
  X(clamped_samples_count, "samples", "contributions lowered to --clamp-direct or --clamp-indirect")           \
  X(invalid_samples_count, "samples", "contributions that were not finite: dropped; the sum of the next six")   \
  X(invalid_emission_count, "samples", "of those, emission that a path met")                                  \
  X(invalid_environment_count, "samples", "of those, the environment that a path met")                        \
  X(invalid_light_count, "samples", "of those, light samples")                                                \
  X(invalid_surface_count, "samples", "of those, surfaces whose colour, normal or lobes were not finite")     \
  X(invalid_bounce_count, "samples", "of those, bounces: the path ended")                                     \
  X(invalid_path_count, "samples", "of those, sums of whole paths")                                           \
  X(film_saturated_count, "samples", "contributions too large for the film: clamped")

// Counters kept for each kind of ray and each bounce.
#define SHOAL_RAY_COUNTERS(X)                                                            \
  X(rays_traced_count, "rays", "rays begun")                                             \
  X(rays_finished_count, "rays", "rays whose answer is known: hits + misses")            \
  X(ray_hits_count, "rays", "rays that hit (shadow: were blocked)")                      \
  X(ray_misses_count, "rays", "rays that left the scene (shadow: arrived)")              \
  X(rays_queued_count, "rays", "rays written to a queue")                                \
  X(rays_drained_count, "rays", "rays taken from a queue")                               \
  X(ray_exits_count, "rays", "a ray leaving a treelet for another one")                  \
  X(node_tests_count, "nodes", "8-wide nodes tested, top tree included")                 \
  X(triangle_tests_count, "triangles", "triangles tested")

struct RayCounters {
#define SHOAL_DECLARE(name, unit, sentence) uint64_t name = 0;
  SHOAL_RAY_COUNTERS(SHOAL_DECLARE)
  void add(const RayCounters& other);
};

enum class RayKind : uint8_t { kCamera, kBounce, kShadow };
inline constexpr std::array<std::string_view, 3> kRayKindNames{"camera", "bounce", "shadow"};
inline constexpr uint32_t kCountedBounces = 32;  ///< later bounces are counted in the last

struct RenderCounters {
  SHOAL_RENDER_COUNTERS(SHOAL_DECLARE)
#undef SHOAL_DECLARE
  /// [kind][bounce]: totals, sums by kind and by bounce all come from this one table.
  std::array<std::array<RayCounters, kCountedBounces>, 3> rays;
  InvalidPlace first_invalid;  ///< where the first of the invalid samples was

  void add(const RenderCounters& other);
  /// Puts what is not finite into its counters.
  void take(const InvalidSamples& invalid);
  RayCounters total() const;
  RayCounters of_kind(RayKind kind) const;
  RayCounters of_bounce(uint32_t bounce) const;
};

struct CounterInfo {
  std::string_view name, unit, sentence;
};
std::vector<CounterInfo> counter_list();

/// What must add up whatever the order: requests = hits + misses, queued = drained, and so on.
/// Fails with: kInternal naming the identity and both numbers.
Status check_identities(const RenderCounters& counters, uint64_t samples_expected);

/// Those of them that hold of a list of rays as well: `samples_expected` of them.
Status check_traffic_identities(const RenderCounters& counters, uint64_t samples_expected);

/// {"totals": {...}, "by_kind": {...}, "by_bounce": [...]} as JSON text.
std::string counters_json(const RenderCounters& counters);

}  // namespace shoal
