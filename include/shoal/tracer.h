// Tracing rays through a scene that need not fit in memory: open a .shoal (made by `shoal build`), make a tracer, hand
// over batches of rays, read their hits. Geometry is paged from the file under a cap on the memory of the process.
//
//   auto scene = shoal::api::Scene::open("island.shoal");
//   if (!scene.ok()) return complain(scene.error().message);
//   shoal::api::TracerOptions options;
//   options.max_memory_bytes = 2ull << 30;
//   auto tracer = shoal::api::Tracer::create(scene.value(), options);
//   ...
//   std::vector<shoal::api::Hit> hits(rays.size());
//   auto report = tracer.value().trace(rays, hits, shoal::api::Query::kClosest);
//
// Hits are a function of scene, ray, Query and TracerOptions::alpha alone, to the last bit: never of order, cap, threads
// or of what else is in the batch.
//
// Threads: a Scene is immutable, any number may use it. A Tracer works on threads of its own; calls to trace() of one
// tracer wait for each other. Several tracers of one scene are independent, each with a cap and a cache of its own;
// but how many threads oneTBB may use is one number for the process: while batches are traced, the least that any of them
// was given.
// Batches: the larger the better, as rays of a batch are gathered by the part of the scene that they are in; below some
// ten thousand an out-of-core scene is read again and again. Pages stay in memory from batch to batch.
// Moved from, a Scene or Tracer can only be destroyed or assigned to.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "shoal/ray.h"
#include "shoal/result.h"

namespace shoal::api {

/// Of this library, "0.1.0".
const char* version();

struct Bounds {
  float lower[3], upper[3];
};

class Scene {
 public:
  /// Reads what stays in memory of a .shoal: the tree down to its pages, tables. Pages are read past the operating
  /// system's cache where the file system allows it, unless `buffered`.
  /// Fails with: kInput (missing, or no .shoal of this version), kCorrupt, kStorage.
  static Result<Scene> open(const std::string& path, bool buffered = false);

  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;
  ~Scene();

  Bounds bounds() const;                ///< world space
  uint64_t triangle_count() const;      ///< an instanced mesh once for each instance
  uint32_t instance_count() const;
  uint64_t page_bytes() const;          ///< all pages decoded: a cache of that size never reads one twice
  uint64_t resident_bytes() const;      ///< what the scene takes without any page

 private:
  friend class Tracer;
  struct Impl;
  explicit Scene(std::shared_ptr<const Impl> impl);
  std::shared_ptr<const Impl> impl_;
};

/// How a batch is traced. Answers are the same; time and what is read from the disk are not.
enum class Order : uint8_t {
  kAuto,        ///< kQueued where pages do not fit under the cap, else the fastest: large batches try them on their rays
  kQueued,      ///< rays wait at the part of the scene that they are in: reads least, for batches larger than memory likes
  kDepthFirst,  ///< ray by ray, as they lie in the batch
  kSorted,      ///< the batch is sorted by origin and direction first, then ray by ray
  kHybrid,      ///< packets and single rays, all pages in memory: fails with kMemoryCap where they do not fit
};

struct TracerOptions {
  Order order = Order::kAuto;
  unsigned threads = 0;  ///< 0: all processors
  /// Cap on the resident memory of the whole process, as it stands when the tracer is made: what the library takes later
  /// stays below it. 0: 70 % of the smaller of physical memory and control-group limits.
  uint64_t max_memory_bytes = 0;
  /// Of the cap, what the program takes for itself after the tracer is made (arrays of rays and hits, say).
  uint64_t reserved_bytes = 0;
  uint64_t largest_batch = 0;  ///< rays; 0: not known. Where it is, no memory is kept for more rays in flight
  bool barycentrics = false;   ///< Hit::u and v; costs one more visit to the page that was hit
  bool alpha = true;           ///< alpha MASK and BLEND of the materials cut holes; false: every triangle is there
};

/// What a batch took. Counts are of this batch alone.
struct TraceReport {
  Order order = Order::kQueued;  ///< that was taken, never kAuto
  double seconds = 0;            ///< wall clock
  uint64_t rays = 0;
  uint64_t hits = 0;
  uint64_t refused = 0;  ///< rays with numbers that are not finite, or a zero direction: answered as misses
  uint64_t node_tests = 0, triangle_tests = 0;
  uint64_t treelet_visits = 0;   ///< a ray crossing a page of geometry
  uint64_t page_loads = 0;       ///< pages read from the file
  uint64_t disk_read_bytes = 0;
  uint64_t peak_cache_bytes = 0;    ///< decoded pages, since the tracer was made
  uint64_t peak_process_bytes = 0;  ///< resident memory of the process, since it began
};

class Tracer {
 public:
  /// Shares out the memory. Keeps the scene open, whatever becomes of `scene`.
  /// Fails with: kMemoryCap, kCorrupt, kStorage.
  static Result<Tracer> create(const Scene& scene, const TracerOptions& options = {});

  Tracer(Tracer&&) noexcept;
  Tracer& operator=(Tracer&&) noexcept;
  ~Tracer();

  /// Writes the answer of rays[i] to hits[i]. Rays and hits stay the caller's; nothing of them is copied.
  /// `stop`, where given, ends the batch with kStopped soon after it became true. After an error the hits are undefined;
  /// after kCorrupt or kStorage make a new tracer.
  /// Fails with: kUsage (not as many hits as rays, or more than 2^32 - 1), kMemoryCap, kCorrupt, kStorage, kStopped,
  /// kInternal.
  Result<TraceReport> trace(std::span<const Ray> rays, std::span<Hit> hits, Query query = Query::kClosest,
                            const std::atomic<bool>* stop = nullptr);

  uint64_t cache_bytes() const;     ///< of decoded pages, at most
  uint64_t rays_in_flight() const;  ///< at most

 private:
  struct Impl;
  explicit Tracer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace shoal::api
