#include "engine/trace_rays.h"

#include <algorithm>
#include <thread>

#include "engine/clock.h"
#include "engine/order_runner.h"
#include "engine/process_memory.h"
#include "engine/ray_list.h"
#include "engine/render_worker.h"

namespace shoal {
namespace {

/// Nothing is shaded: of all effects only what decides where triangles are.
constexpr uint32_t kWithoutShading = (kAllMaterialEffects | kAllSceneEffects) & ~(kEffectCoverage | kEffectMotion);

/// What the plan and the loops take for the picture: as many samples as rays.
PictureOptions picture_of(const TraceOptions& options) {
  PictureOptions picture;
  picture.width = picture.height = 1;
  picture.samples = static_cast<uint32_t>(std::min(options.largest_list, RayTracer::kMostRays));
  if (picture.samples == 0) picture.samples = static_cast<uint32_t>(RayTracer::kMostRays);
  picture.shading.effects.off = kWithoutShading;
  picture.shading.triangle_test = options.triangle_test;
  return picture;
}

ExecutionOptions execution_of(const TraceOptions& options) {
  ExecutionOptions execution = options.execution;
  if (execution.threads == 0) execution.threads = std::max(1u, std::thread::hardware_concurrency());
  execution.preview = {};
  execution.time_limit_seconds = 0;
  execution.mapped_pages = nullptr;
  return execution;
}

/// What was counted after `before`.
CacheCounters difference(const CacheCounters& now, const CacheCounters& before) {
  CacheCounters d = now;
  d.page_requests_count -= before.page_requests_count;
  d.page_hits_count -= before.page_hits_count;
  d.page_misses_count -= before.page_misses_count;
  d.page_prefetches_count -= before.page_prefetches_count;
  d.page_evictions_count -= before.page_evictions_count;
  d.disk_reads_count -= before.disk_reads_count;
  d.disk_read_bytes -= before.disk_read_bytes;
  d.decoded_bytes -= before.decoded_bytes;
  d.treelet_loads_count -= before.treelet_loads_count;
  d.treelet_load_bytes -= before.treelet_load_bytes;
  d.attribute_loads_count -= before.attribute_loads_count;
  d.texture_loads_count -= before.texture_loads_count;
  return d;
}

}  // namespace

struct RayTracer::State {
  State(const Scene& traced, const TraceOptions& asked, std::unique_ptr<ShadingTables> shading, ObjectIds ids,
        const ExecutionOptions& with, const MemoryPlan& shared_out)
      : scene(traced),
        options(asked),
        picture(picture_of(asked)),
        execution(with),
        tables(std::move(shading)),
        objects(std::move(ids)),
        plan(shared_out),
        camera(frame_camera(traced.top_tree.bounds()), 1, 1),
        sampler(SamplerKind::kIndependent, 0, 1, 1, 1),
        film(1, 1),
        orders(traced, execution, plan, picture.samples),
        cache(*traced.file, plan.cache_bytes,
              [&traced](const PageRecord& record, std::span<const std::byte> bytes) {
                return check_page(traced, record, bytes);
              },
              orders.waiting_work(), execution.paging) {}

  const Scene& scene;
  const TraceOptions options;
  const PictureOptions picture;
  const ExecutionOptions execution;
  const std::unique_ptr<ShadingTables> tables;
  const ObjectIds objects;
  const MemoryPlan plan;
  const Camera camera;  // this and the next two are never asked for anything
  const Sampler sampler;
  Film film;
  OrderRunner orders;
  PageCache cache;
};

RayTracer::RayTracer(std::unique_ptr<State> state) : state_(std::move(state)) {}
RayTracer::~RayTracer() = default;
const MemoryPlan& RayTracer::plan() const { return state_->plan; }
unsigned RayTracer::threads() const { return state_->execution.threads; }

Result<std::unique_ptr<RayTracer>> RayTracer::create(FileSystem& fs, const Scene& scene, const TraceOptions& options) {
  ExecutionOptions execution = execution_of(options);
  const PictureOptions picture = picture_of(options);
  SHOAL_RETURN_IF_ERROR(check_policies(execution));
  SHOAL_ASSIGN_OR_RETURN(ObjectIds objects, ObjectIds::read(*scene.file));
  SHOAL_ASSIGN_OR_RETURN(std::unique_ptr<ShadingTables> tables,
                         ShadingTables::create(fs, scene, picture.shading, execution.threads));
  if (execution.process_bytes == 0) {
    const uint64_t known = scene.resident_bytes() + tables->resident_bytes(), resident = resident_set_bytes();
    execution.process_bytes = resident - std::min(known, resident);
  }
  execution.process_bytes += options.kept_bytes;
  SHOAL_ASSIGN_OR_RETURN(const MemoryPlan plan, plan_memory(scene, *tables, picture, execution));
  execution.paging.read_depth = plan.read_depth;
  auto state = std::make_unique<State>(scene, options, std::move(tables), std::move(objects), execution, plan);
  return std::unique_ptr<RayTracer>(new RayTracer(std::move(state)));
}

Result<TraceReport> RayTracer::trace(std::span<const QueryRay> rays, RayQuery query, std::span<RayHit> hits,
                                     const RenderHooks& hooks) {
  SHOAL_CHECK(rays.size() == hits.size());
  RaySpans source(rays, hits);
  return trace(source, rays.size(), query, hooks);
}

Result<TraceReport> RayTracer::trace(RaySource& rays, uint64_t count, RayQuery query, const RenderHooks& hooks) {
  SHOAL_CHECK(count <= kMostRays);
  State& s = *state_;
  const double start = now_seconds();
  const uint64_t start_ticks = now_ticks();
  RayList list(rays, {query, s.options.coverage && s.tables->has_coverage(), s.options.points, s.options.triangle_test},
               s.objects);
  const SampleOrder samples(1, 1, static_cast<uint32_t>(count));
  RenderHooks heard = hooks;
  heard.recorder = nullptr;
  RenderContext context{s.scene, s.picture, *s.tables, s.camera, samples, s.sampler, heard, s.cache, s.film,
                        s.execution.threads};
  context.list = &list;
  context.start_seconds = start;
  context.phases.assign(s.execution.threads, PhaseClock(start_ticks));
  context.forecast = {count, 0};
  context.forecast.mark(0, 0);
  const CacheCounters before = s.cache.background_counters();
  if (count > 0) s.orders.run(context);
  s.cache.finish_loads();
  if (!context.error.ok()) {
    s.orders.release();  // rays of this list wait in its queues
    return std::move(context.error).error();
  }
  add_cache_counters(difference(s.cache.background_counters(), before), context.counters);
  SHOAL_RETURN_IF_ERROR(check_traffic_identities(context.counters, count));
  TraceReport report;
  report.counters = context.counters;
  report.order = s.orders.chosen();
  report.refused_count = list.refused_count();
  report.peak_cache_bytes = s.cache.peak_resident_bytes();
  report.peak_process_bytes = peak_resident_set_bytes();
  const uint64_t ticks = now_ticks();
  report.seconds = now_seconds() - start;
  for (PhaseClock& clock : context.phases) clock.settle(ticks);
  report.phases = phase_times(context.phases,
                              report.seconds / static_cast<double>(std::max<uint64_t>(ticks - start_ticks, 1)));
  return report;
}

Result<TracedRays> trace_rays(FileSystem& fs, const Scene& scene, std::span<const QueryRay> rays, RayQuery query,
                              const TraceOptions& options, const RenderHooks& hooks) {
  TracedRays traced;
  if (rays.size() > RayTracer::kMostRays) {
    return Error{ErrorCode::kUsage, "a list of more than 4294967295 rays: trace it in parts"};
  }
  traced.hits.resize(rays.size());  // before the plan, which sees it then
  TraceOptions of_list = options;
  of_list.largest_list = std::max<uint64_t>(rays.size(), 1);
  SHOAL_ASSIGN_OR_RETURN(const std::unique_ptr<RayTracer> tracer, RayTracer::create(fs, scene, of_list));
  traced.plan = tracer->plan();
  if (hooks.planned) hooks.planned(traced.plan);
  SHOAL_ASSIGN_OR_RETURN(traced.report, tracer->trace(rays, query, traced.hits, hooks));
  return traced;
}

}  // namespace shoal
