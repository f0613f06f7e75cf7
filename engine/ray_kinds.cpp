#include "engine/ray_kinds.h"

#include <algorithm>
#include <thread>

#include "engine/process_memory.h"

namespace shoal {
namespace {

constexpr uint64_t kTilePixels = uint64_t{RayRecorder::kTile} * RayRecorder::kTile;
/// Of the cap, for the lists: chosen.
constexpr uint64_t kCapShare = 8;

const KindFigures& median(const std::vector<KindRun>& runs, KindFigures KindRun::*which) {
  std::vector<const KindFigures*> by_time;
  for (const KindRun& run : runs) by_time.push_back(&(run.*which));
  const auto middle = by_time.begin() + static_cast<ptrdiff_t>((by_time.size() - 1) / 2);
  std::nth_element(by_time.begin(), middle, by_time.end(),
                   [](const KindFigures* a, const KindFigures* b) { return a->seconds < b->seconds; });
  return **middle;
}

KindFigures figures_of(const TraceReport& report) {
  const RenderCounters& counters = report.counters;
  const RayCounters rays = counters.total();
  KindFigures figures;
  figures.seconds = report.seconds;
  figures.rays_count = rays.rays_traced_count, figures.hits_count = rays.ray_hits_count;
  figures.node_tests_count = rays.node_tests_count, figures.triangle_tests_count = rays.triangle_tests_count;
  figures.treelet_visits_count = counters.treelet_visits_count;
  figures.treelet_loads_count = counters.treelet_loads_count;
  figures.disk_read_bytes = counters.disk_read_bytes;
  return figures;
}

bool asks_for_any(RayBirth birth) { return birth == RayBirth::kPointShadow || birth == RayBirth::kAreaShadow; }

struct TracedKind {
  const RecordedKind& kind;
  std::vector<RayHit> first;  ///< of the first order
  std::vector<RayHit> hits;
};

/// How rays are taken: under what is left of the cap beside them.
struct TakingPlan {
  PictureOptions part;
  ExecutionOptions execution;
  uint64_t list_bytes = 0;  ///< at most
};

TakingPlan plan_taking(const PictureOptions& picture, const ExecutionOptions& asked, const KindOptions& options) {
  TakingPlan plan{{}, asked, 0};
  ExecutionOptions& execution = plan.execution;
  if (execution.max_memory_bytes == 0) execution.max_memory_bytes = default_cap_bytes();
  if (execution.threads == 0) execution.threads = std::max(1u, std::thread::hardware_concurrency());
  execution.order = Order::kAuto;
  execution.preview = {};
  execution.time_limit_seconds = 0;
  const uint64_t bounces = picture.shading.bounces;
  const uint64_t fitting = execution.max_memory_bytes / kCapShare / RayRecorder::bytes(1, bounces);
  const uint64_t paths = std::max<uint64_t>(std::min(options.rays, fitting), kTilePixels);
  plan.part = part_for_kinds(picture, paths);
  plan.list_bytes = RayRecorder::bytes(paths, bounces);
  execution.max_memory_bytes -= std::min(execution.max_memory_bytes - 1, plan.list_bytes);
  return plan;
}

/// One run of one order, cold and warm.
Result<KindRun> trace_run(FileSystem& fs, const Scene& scene, TracedKind& traced, const TraceOptions& options,
                          const RenderHooks& hooks, bool& identical) {
  const RayQuery query = asks_for_any(traced.kind.birth) ? RayQuery::kAny : RayQuery::kClosest;
  SHOAL_ASSIGN_OR_RETURN(const std::unique_ptr<RayTracer> tracer, RayTracer::create(fs, scene, options));
  KindRun run;
  for (KindFigures* figures : {&run.cold, &run.warm}) {
    SHOAL_ASSIGN_OR_RETURN(const TraceReport report, tracer->trace(traced.kind.rays, query, traced.hits, hooks));
    *figures = figures_of(report);
    if (traced.first.empty()) traced.first = traced.hits;
    identical = identical && traced.hits == traced.first;
  }
  return run;
}

}  // namespace

const KindFigures& KindInOrder::cold() const { return median(runs, &KindRun::cold); }
const KindFigures& KindInOrder::warm() const { return median(runs, &KindRun::warm); }

PictureOptions part_for_kinds(const PictureOptions& picture, uint64_t rays) {
  PictureOptions part = picture;
  part.aovs = {};
  part.noise = {};
  const uint64_t pixels = uint64_t{picture.width} * picture.height;
  const uint64_t tile_pixels = std::min(kTilePixels, pixels);
  part.samples = static_cast<uint32_t>(std::clamp<uint64_t>(rays / tile_pixels, 1, picture.samples));
  const uint64_t tiles = std::max<uint64_t>(rays / (tile_pixels * part.samples), 1);
  const uint64_t across = (picture.width + RayRecorder::kTile - 1) / RayRecorder::kTile;
  const uint64_t down = (picture.height + RayRecorder::kTile - 1) / RayRecorder::kTile;
  const auto one_in = static_cast<uint32_t>((across * down + tiles - 1) / tiles);
  part.tile_sample = std::max(picture.tile_sample, one_in);
  return part;
}

Status check_kinds_fit(FileSystem& fs, const Scene& scene, const PictureOptions& picture,
                       std::span<const ExecutionOptions> orders, const KindOptions& options) {
  if (orders.empty()) return {};
  const TakingPlan taking = plan_taking(picture, orders[0], options);
  SHOAL_ASSIGN_OR_RETURN(const std::unique_ptr<ShadingTables> tables,
                         ShadingTables::create(fs, scene, picture.shading, taking.execution.threads));
  if (const auto plan = plan_memory(scene, *tables, taking.part, taking.execution); !plan.ok()) return plan.error();
  for (const ExecutionOptions& execution : orders) {
    TraceOptions tracing;
    tracing.execution = execution;
    tracing.kept_bytes = taking.list_bytes;
    if (const auto tracer = RayTracer::create(fs, scene, tracing); !tracer.ok()) return tracer.error();
  }
  return {};
}

Result<TakenKinds> take_kinds(FileSystem& fs, const Scene& scene, const PictureOptions& picture,
                              const ExecutionOptions& asked, const KindOptions& options, const RenderHooks& hooks) {
  const TakingPlan plan = plan_taking(picture, asked, options);
  TakenKinds taken;
  taken.samples = plan.part.samples, taken.tile_sample = plan.part.tile_sample;
  RayRecorder recorder(plan.part.width, plan.execution.threads);
  RenderHooks heard = hooks;
  heard.recorder = &recorder;
  SHOAL_ASSIGN_OR_RETURN(const RenderResult result, render(fs, scene, plan.part, plan.execution, heard));
  taken.paths_count = result.counters.samples_committed_count;
  taken.kinds = recorder.take();
  give_back_freed_memory();  // blocks of a few rays each
  if (!options.births.empty()) {
    std::erase_if(taken.kinds, [&](const RecordedKind& kind) {
      return std::find(options.births.begin(), options.births.end(), kind.birth) == options.births.end();
    });
  }
  return taken;
}

Result<std::vector<KindRow>> trace_kinds(FileSystem& fs, const Scene& scene, const TakenKinds& taken,
                                         const ShadingOptions& shading, std::span<const ExecutionOptions> orders,
                                         uint32_t runs, const std::function<void(size_t, size_t)>& done,
                                         const RenderHooks& hooks) {
  uint64_t kept_bytes = 0, longest = 0;
  for (const RecordedKind& kind : taken.kinds) {
    kept_bytes += kind.rays.size() * sizeof(QueryRay);
    longest = std::max<uint64_t>(longest, kind.rays.size());
  }
  kept_bytes += 2 * longest * sizeof(RayHit);
  std::vector<KindRow> rows;
  for (const RecordedKind& kind : taken.kinds) {
    KindRow row{kind.birth, kind.bounce, kind.rays.size(), {}, true};
    for (const ExecutionOptions& execution : orders) row.orders.push_back({execution.order, {}});
    TracedKind traced{kind, {}, std::vector<RayHit>(kind.rays.size())};
    for (uint32_t run = 0; run < runs; ++run) {
      for (size_t i = 0; i < orders.size(); ++i) {
        TraceOptions options;
        options.execution = orders[i];
        options.triangle_test = shading.triangle_test;
        options.largest_list = kind.rays.size();
        // What the process holds is either told, without the lists, or measured, with them.
        options.kept_bytes = orders[i].process_bytes > 0 ? kept_bytes : kind.rays.size() * sizeof(RayHit);
        SHOAL_ASSIGN_OR_RETURN(KindRun traced_run, trace_run(fs, scene, traced, options, hooks, row.identical));
        row.orders[i].runs.push_back(std::move(traced_run));
      }
    }
    rows.push_back(std::move(row));
    if (done) done(rows.size(), taken.kinds.size());
  }
  return rows;
}

}  // namespace shoal
