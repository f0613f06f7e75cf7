// The kinds of rays of a picture, apart from each other, in several orders: how rays of a kind run together is a property
// of the rays and the scene, so what an order is worth is told a kind at a time. First the rays of a part of the picture
// are taken down while it is rendered; then the list of each kind is traced by itself (engine/trace_rays) in each order.
// Called by `shoal compare --kinds`.
//
// Which rays: those of whole tiles of 32 x 32 pixels, the tiles spread over the picture (PictureOptions::tile_sample), and
// of the first samples of their pixels: as many of both that camera rays stay below KindOptions::rays. Every other kind
// and bounce has at most one ray a path, so no list is longer. Neighbours stay neighbours: nothing is thinned out inside
// a tile. The lists are the same whatever the order and the threads.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "engine/ray_recorder.h"
#include "engine/trace_rays.h"

namespace shoal {

struct KindOptions {
  uint64_t rays = 64 << 10;  ///< of each kind and bounce, at most; at least one tile with one sample a pixel is taken
  uint32_t runs = 1;         ///< of each order
  std::vector<RayBirth> births{};  ///< empty: all
};

struct TakenKinds {
  std::vector<RecordedKind> kinds;  ///< by birth, then bounce
  uint64_t paths_count = 0;
  uint32_t samples = 0;       ///< of a pixel
  uint32_t tile_sample = 1;   ///< one in so many tiles
};

/// What part of `picture` is taken for so many camera rays. Its other options are those that change no ray.
PictureOptions part_for_kinds(const PictureOptions& picture, uint64_t rays);

/// Whether the cap leaves room for taking the rays and for tracing them in each order: to be asked before long work.
/// Fails with: kMemoryCap (the message names the smallest that would), kInput (environment), kCorrupt.
Status check_kinds_fit(FileSystem& fs, const Scene& scene, const PictureOptions& picture,
                       std::span<const ExecutionOptions> orders, const KindOptions& options);

/// Renders that part. Under a small cap fewer rays are taken: the lists get an eighth of it at most.
/// Fails with: what render() fails with.
Result<TakenKinds> take_kinds(FileSystem& fs, const Scene& scene, const PictureOptions& picture,
                              const ExecutionOptions& execution, const KindOptions& options, const RenderHooks& hooks = {});

/// What tracing a list once took.
struct KindFigures {
  double seconds = 0;
  uint64_t rays_count = 0, hits_count = 0;
  uint64_t node_tests_count = 0, triangle_tests_count = 0;
  uint64_t treelet_visits_count = 0;  ///< a ray crossing a treelet
  uint64_t treelet_loads_count = 0, disk_read_bytes = 0;
};
/// Of one kind in one order, a run: the list from a cold page cache, and at once again with what stayed in it.
struct KindRun {
  KindFigures cold, warm;
};
struct KindInOrder {
  Order order = Order::kQueued;
  std::vector<KindRun> runs;

  /// The runs that took the median time; of an even number, the faster of the two in the middle.
  const KindFigures& cold() const;
  const KindFigures& warm() const;
};
struct KindRow {
  RayBirth birth = RayBirth::kCamera;
  uint32_t bounce = 0;
  uint64_t rays_count = 0;
  std::vector<KindInOrder> orders;  ///< as they were asked for
  bool identical = true;            ///< hits of all orders and runs, to the bit
};

/// Traces every kind in every order, under the cap of that order's options. Shadow rays ask for any hit, others for the
/// closest. Orders take turns, run by run. `done(rows, of)` is called after every row.
/// Fails with: what RayTracer fails with.
Result<std::vector<KindRow>> trace_kinds(FileSystem& fs, const Scene& scene, const TakenKinds& taken,
                                         const ShadingOptions& shading, std::span<const ExecutionOptions> orders,
                                         uint32_t runs, const std::function<void(size_t, size_t)>& done = {},
                                         const RenderHooks& hooks = {});

}  // namespace shoal
