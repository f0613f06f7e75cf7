#include "engine/render_worker.h"

#include <cmath>
#include <new>

#include "engine/adaptive_sampling.h"
#include "engine/aov_film.h"
#include "engine/checkpoint.h"
#include "engine/clock.h"
#include "engine/preview.h"
#include "engine/ray_list.h"
#include "engine/ray_recorder.h"
#include "engine/render_record.h"
#include "engine/run_on_threads.h"
#include "engine/touch_recorder.h"

namespace shoal {
namespace {

/// The length of a ray that enters no box.
constexpr float kRayNowhere = -1;

}  // namespace

void RenderContext::fail(Error new_error) {
  std::lock_guard guard(mutex);
  if (error.ok()) error = std::move(new_error);
  ended.store(true, std::memory_order_relaxed);
}

SampleRange RenderContext::begin_samples(uint64_t wanted) {
  uint64_t first = next_sample.load(std::memory_order_relaxed), last = 0;
  do {
    last = std::min(first + wanted, begin_limit());
    if (last <= first) return {first, first};
  } while (!next_sample.compare_exchange_weak(first, last));
  return {first, last};
}

void RenderContext::end_pass() {
  samples_before += samples_done;
  next_sample = samples_done = end_sample = 0;
  again.clear();
  again_first = 0;
  forecast.mark(samples_before, now_seconds() - start_seconds);
}

void run_on_threads(RenderContext& context, const std::function<void(unsigned)>& work) {
  const auto all_enter = [&](Phase phase) {
    for (PhaseClock& clock : context.phases) clock.enter(phase);
  };
  all_enter(Phase::kIdle);  // until they are there, and once they are done
  run_on_threads(context.threads, [&](unsigned thread) {
    try {
      work(thread);
    } catch (const std::bad_alloc&) {
      context.ended = true;  // first: the message allocates
      context.fail({ErrorCode::kMemoryCap, "out of memory while rendering: lower --max-memory to what the machine has"});
    }
    context.phases[thread].enter(Phase::kIdle);
  });
  all_enter(Phase::kSetup);
}

RenderWorker::RenderWorker(RenderContext& context, unsigned thread)
    : context_(context),
      thread_(thread),
      phases_(context.phases[thread]),
      shader_(context.scene, context.tables, context.picture.shading, context.sampler, context.cache),
      camera_cone_(shader_.follows_cones() ? pack_cone(context.camera.cone()) : 0),
      seeds_{context.sampler, context.tables.has_coverage(),
             shutter_times(context.scene.top_tree, context.picture.shading.effects)},
      touches_(context.touches != nullptr ? &context.touches->log(thread) : nullptr),
      aovs_(context.aovs) {
  if (context.record != nullptr) {
    record_ = &context.record->thread(thread);
    record_progress(false);
  }
  if (aovs_ == nullptr) return;
  seeks_ = aovs_->set().of_surface();
  if (aovs_->set().has(Aov::kTreelets)) visits_aovs_ = aovs_;
  if (aovs_->set().has(Aov::kBytes)) loads_aovs_ = aovs_;
}

Ray RenderWorker::begin_path(uint64_t index, uint32_t path_index, PathState& path) {
  enter(Phase::kPaths);
  if (context_.list != nullptr) return begin_listed(index, path_index, path);
  const UnfinishedSample sample = context_.sample_at(index);
  const uint32_t x = sample.pixel % context_.picture.width, y = sample.pixel / context_.picture.width;
  path.pixel = sample.pixel;
  path.sample = sample.sample;
  path.bounce = 0;
  path.seeks = seeks_ && counts(path.pixel, path.sample) ? sample.seeks & 3 : kSeeksNothing;
  path.under_way = 1;
  path.flags = kPathGoesOn;
  path.throughput = Vec3(1);
  path.bsdf_pdf = 0;
  path.medium = 0;
  path.radiance = Vec3(0);
  path.shadow_radiance = Vec3(0);
  const Sampler& sampler = context_.sampler;
  const Random4 in_pixel = sampler.draw(path.pixel, path.sample, 0, Dimension::kPixel);
  const Random4 on_lens =
      context_.camera.has_aperture() ? sampler.draw(path.pixel, path.sample, 0, Dimension::kLens) : Random4{};
  const Camera& camera = context_.camera;
  const CameraRay camera_ray =
      camera.moves()
          ? camera.at(time_of(path, sampler, ShutterTimes::kSpread)).ray(x, y, in_pixel, on_lens)
          : camera.ray(x, y, in_pixel, on_lens);
  path.origin = camera_ray.origin;
  path.direction = camera_ray.direction;
  path.cone = camera_cone_;
  path.hit = Hit{};
  path.pending.store(1, std::memory_order_relaxed);
  ++counters_.samples_started_count;
  move_state(path);
  if (!camera_ray.seen) path.throughput = Vec3(0);
  const float t_max = camera_ray.seen ? kRayInfinity : kRayNowhere;
  const Ray ray = make_ray(path_index, path, seeds_, path.origin, path.direction, t_max, false);
  ++ray_counters(ray).rays_traced_count;
  if (context_.hooks.recorder != nullptr && camera_ray.seen) {
    context_.hooks.recorder->add(thread_, RayBirth::kCamera, 0, path, ray);
  }
  return ray;
}

Ray RenderWorker::begin_listed(uint64_t index, uint32_t path_index, PathState& path) {
  Ray ray = context_.list->begin(index, path);
  ray.path = path_index | (context_.list->any_hit() ? Ray::kAnyHitBit : 0u);
  ++counters_.samples_started_count;
  move_state(path);
  ++ray_counters(ray).rays_traced_count;
  return ray;
}

void RenderWorker::count_leaving(const GroupRay& member, TreeletId next) {
  RayCounters& rays = ray_counters(member.ray);
  rays.node_tests_count += member.node_tests;
  rays.triangle_tests_count += member.triangle_tests;
  if (member.traced && next != kNoIndex) ++rays.ray_exits_count;
}

bool RenderWorker::finish_ray(const Ray& ray, PathState& path) {
  RayCounters& rays = ray_counters(ray);
  ++rays.rays_finished_count;
  ++(ray.hit.valid() ? rays.ray_hits_count : rays.ray_misses_count);
  move_state(path);
  if (context_.list != nullptr) {
    context_.list->finish(ray, path);
  } else if (ray.any_hit()) {
    if (!ray.hit.valid()) path.radiance += path.shadow_radiance;
  } else {
    path.hit = ray.hit;
    path.t = ray.t;
    if (path.bounce == 0 && ray.hit.valid()) path.flags |= kPathCovered;
  }
  return path.pending.fetch_sub(1, std::memory_order_acq_rel) == 1;
}

uint32_t RenderWorker::shade(uint32_t path_index, PathState& path, Ray rays[2]) {
  enter(Phase::kShading);
  if (context_.list != nullptr) {
    context_.list->find_point(path, context_.scene.top_tree, geometry_.bytes());
    ++shade_counters_.vertices_shaded_count;
    move_state(path);
    path.flags &= ~uint32_t{kPathGoesOn};
    return 0;
  }
  const uint64_t waited_before = cache_counters_.waited_ticks;
  if (!pin_attributes()) return 0;
  const uint64_t waited_for_page = cache_counters_.waited_ticks;
  const uint32_t bounce_before = path.bounce;
  ShadeResult result;
  Status status = shader_.shade_hit(path, geometry_.bytes(), attributes_.bytes(), result, shade_counters_,
                                    cache_counters_);
  if (const uint64_t waited = cache_counters_.waited_ticks - waited_before; waited > 0) {
    const uint64_t now = now_ticks();
    phases_.give_to(Phase::kPaging, waited, now);
    const uint64_t for_textures = cache_counters_.waited_ticks - waited_for_page;
    if (record_ != nullptr && record_->traces() && for_textures > 0) {
      record_->note_wait(kNoIndex, now - for_textures, now, 0);
    }
  }
  if (!status.ok()) {
    context_.fail(std::move(status).error());
    return 0;
  }
  move_state(path);
  uint32_t count = 0;
  if (result.has_shadow) {
    const uint32_t bounce_after = path.bounce;
    path.bounce = bounce_before;  // the shadow ray belongs to the vertex that it leaves
    rays[count++] = make_ray(path_index, path, seeds_, result.shadow_origin, result.shadow_direction,
                             result.shadow_t_max, true);
    path.bounce = bounce_after;
  }
  if (path.seeks != 0) note_features(path, bounce_before, result.has_bounce);
  charge_loads(path.pixel);
  path.flags &= ~uint32_t{kPathGoesOn};
  if (result.has_bounce) {
    path.flags |= kPathGoesOn;
    path.origin = result.bounce_origin;
    path.direction = result.bounce_direction;
    path.hit = Hit{};
    rays[count++] = make_ray(path_index, path, seeds_, path.origin, path.direction, kRayInfinity, false);
  }
  for (uint32_t i = 0; i < count; ++i) ++ray_counters(rays[i]).rays_traced_count;
  if (context_.hooks.recorder != nullptr) record(result, path, rays);
  path.pending.store(count, std::memory_order_relaxed);
  return count;
}

void RenderWorker::record(const ShadeResult& result, const PathState& path, const Ray* rays) const {
  RayRecorder& recorder = *context_.hooks.recorder;
  const uint32_t vertex = result.has_bounce ? path.bounce - 1 : path.bounce;
  if (result.has_shadow) recorder.add(thread_, result.shadow_birth, vertex, path, *rays++);
  if (result.has_bounce) recorder.add(thread_, result.bounce_birth, path.bounce, path, *rays);
}

void RenderWorker::shade_miss(PathState& path) {
  enter(Phase::kShading);
  shader_.shade_miss(path, shade_counters_);
}

bool RenderWorker::counts(uint32_t pixel, uint32_t sample) const {
  return context_.adaptive == nullptr || context_.adaptive->counts(pixel, sample);
}

void RenderWorker::end_path(PathState& path) {
  enter(Phase::kPaths);
  path.under_way = 0;
  if (context_.list != nullptr) {
    ++counters_.samples_committed_count;
    move_state(path);
    return;
  }
  Vec3 radiance = path.radiance;
  if (!std::isfinite(radiance.x) || !std::isfinite(radiance.y) || !std::isfinite(radiance.z)) {
    radiance = Vec3(0);
    invalid_.add(InvalidTerm::kPath, path);
  }
  const bool covered = (path.flags & kPathCovered) != 0;
  uint32_t half = 0;
  if (context_.adaptive != nullptr) {
    context_.adaptive->add(path.pixel, path.sample, radiance, covered);
    half = AdaptiveSampling::half_of(path.sample);
  }
  if (counts(path.pixel, path.sample)) {
    if (aovs_ != nullptr) end_features(path, radiance);
    if (!context_.film.add(path.pixel, radiance, covered, half)) ++counters_.film_saturated_count;
  }
  ++counters_.samples_committed_count;
  move_state(path);
}

PagePin RenderWorker::pin(TreeletId treelet) {
  const uint64_t decoded = cache_counters_.decoded_bytes, waited = cache_counters_.waited_ticks;
  Result<PagePin> pin = context_.cache.pin(context_.scene.treelets[treelet].geometry, cache_counters_);
  if (record_ != nullptr) record_pin(treelet, true, decoded, waited);
  if (!pin.ok()) {
    context_.fail(std::move(pin).error());
    return {};
  }
  if (touches_ != nullptr && cache_counters_.decoded_bytes != decoded) [[unlikely]] {
    const std::span<const std::byte> page = pin.value().bytes();
    touches_->write(page.data(), page.size(), TouchKind::kPages);
  }
  return std::move(pin).value();
}

void RenderWorker::count_batch(const PagePin& geometry) {
  ++counters_.treelet_batches_count;
  counters_.treelet_visit_bytes += geometry.bytes().size();
  if (record_ != nullptr) record_->note_batch(geometry.page());
}

bool RenderWorker::hold(TreeletId treelet) {
  enter(Phase::kPaging);
  let_go();
  if (record_ != nullptr) record_begin_hand(treelet);
  geometry_ = pin(treelet);
  if (!geometry_) return false;
  in_hand_ = treelet;
  return true;
}

bool RenderWorker::take_in_hand(TreeletId treelet) {
  if (treelet == in_hand_) return true;
  if (!hold(treelet)) return false;
  count_batch(geometry_);
  return true;
}

void RenderWorker::let_go() {
  if (record_ != nullptr) record_end_hand();
  geometry_.reset();
  attributes_.reset();
  in_hand_ = attributes_of_ = kNoIndex;
}

bool RenderWorker::attributes_at_hand() const {
  if (attributes_of_ == in_hand_ || context_.list != nullptr) return true;
  const PageId page = context_.scene.treelets[in_hand_].attributes;
  return page == kNoPage || context_.cache.resident(page);
}

bool RenderWorker::pin_attributes() {
  if (attributes_of_ == in_hand_ || context_.list != nullptr) return true;
  const PageId page = context_.scene.treelets[in_hand_].attributes;
  attributes_.reset();
  if (page != kNoPage) {
    const uint64_t decoded = cache_counters_.decoded_bytes, waited = cache_counters_.waited_ticks;
    Result<PagePin> pin = context_.cache.pin(page, cache_counters_);
    if (record_ != nullptr) record_pin(in_hand_, false, decoded, waited);
    if (!pin.ok()) {
      context_.fail(std::move(pin).error());
      return false;
    }
    attributes_ = std::move(pin).value();
  }
  attributes_of_ = in_hand_;
  return true;
}

void RenderWorker::report_progress() {
  enter(Phase::kReporting);
  if (record_ != nullptr) record_progress(true);
  context_.disk_read_bytes += cache_counters_.disk_read_bytes - disk_bytes_reported_;
  disk_bytes_reported_ = cache_counters_.disk_read_bytes;
  const bool stop = context_.hooks.stop != nullptr && context_.hooks.stop->load(std::memory_order_relaxed);
  if (context_.checkpoints != nullptr) {
    context_.checkpoints->write_when_due(context_, stop);
  } else if (stop) {
    context_.fail({ErrorCode::kStopped, "the render was stopped before it was complete"});
  }
  safe_point();
  if (Status failure = context_.cache.failure(); !failure.ok()) context_.fail(std::move(failure).error());
  if (context_.preview != nullptr && !context_.ended) context_.preview->show_when_due(context_.all_samples_done());
  if (!context_.hooks.progress) return;
  const double now = now_seconds();
  if (now < next_report_seconds_ || !context_.mutex.try_lock()) return;
  next_report_seconds_ = now + 0.2;
  std::lock_guard guard(context_.mutex, std::adopt_lock);
  const uint64_t done = context_.all_samples_done();
  const double seconds = now - context_.start_seconds;
  context_.hooks.progress({done, context_.forecast.samples_total,
                           context_.disk_read_bytes + context_.cache.background_read_bytes(), seconds,
                           context_.preview != nullptr ? context_.preview->first() : std::nullopt,
                           context_.forecast.fraction(done, seconds), context_.forecast.seconds_left(done, seconds),
                           context_.samples_restored});
}

void add_cache_counters(const CacheCounters& cache, RenderCounters& c) {
  c.page_requests_count += cache.page_requests_count;
  c.page_hits_count += cache.page_hits_count;
  c.page_misses_count += cache.page_misses_count;
  c.page_prefetches_count += cache.page_prefetches_count;
  c.page_evictions_count += cache.page_evictions_count;
  c.disk_reads_count += cache.disk_reads_count;
  c.disk_read_bytes += cache.disk_read_bytes;
  c.decoded_bytes += cache.decoded_bytes;
  c.treelet_loads_count += cache.treelet_loads_count;
  c.treelet_load_bytes += cache.treelet_load_bytes;
  c.attribute_loads_count += cache.attribute_loads_count;
  c.texture_loads_count += cache.texture_loads_count;
}

void RenderWorker::hand_in() {
  let_go();
  RenderCounters& c = counters_;
  add_cache_counters(cache_counters_, c);
  c.coverage_tests_count = trace_counters_.coverage_tests_count;
  c.simd_lanes_count = trace_counters_.simd_lanes_count;
  c.simd_active_lanes_count = trace_counters_.simd_active_lanes_count;
  c.vertices_shaded_count = shade_counters_.vertices_shaded_count;
  c.texture_lookups_count = shade_counters_.texture_lookups_count;
  c.texture_tiles_pinned_count = shader_.texture_tiles_pinned_count();
  c.clamped_samples_count = shade_counters_.clamped_samples_count;
  c.take(shade_counters_.invalid);
  c.take(invalid_);
  if (record_ != nullptr) record_progress(false);
  std::lock_guard guard(context_.mutex);
  context_.counters.add(c);
}

}  // namespace shoal
