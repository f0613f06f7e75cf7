#include "engine/render.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <thread>

#include "engine/adaptive_sampling.h"
#include "engine/aov_film.h"
#include "engine/clock.h"
#include "engine/order_runner.h"
#include "engine/preview.h"
#include "treelets/scene_traversal.h"

namespace shoal {
namespace {

CameraRecord camera_record(const Scene& scene, const PictureOptions& picture) {
  return scene.cameras.empty() ? frame_camera(scene.top_tree.bounds()) : scene.cameras[picture.camera];
}

/// Where the camera stands at even times of the shutter; none where it stands still.
std::span<const Affine3> camera_keys(const Scene& scene, const CameraRecord& camera, const EffectChoice& effects) {
  if ((effects.off & kEffectMotion) != 0) return {};
  return std::span(scene.camera_keys).subspan(camera.first_key, camera.key_count);
}

Status check_options(const Scene& scene, const PictureOptions& picture, const ExecutionOptions& execution) {
  SHOAL_RETURN_IF_ERROR(check_picture(picture));
  const size_t cameras = std::max<size_t>(scene.cameras.size(), 1);
  if (picture.camera >= cameras) {
    return Error{ErrorCode::kUsage,
                 fmt::format("camera {} was asked for, the scene has {}", picture.camera, scene.cameras.size())};
  }
  SHOAL_RETURN_IF_ERROR(check_lens(camera_record(scene, picture), picture.lens));
  if (!(execution.time_limit_seconds >= 0)) {
    return Error{ErrorCode::kUsage, fmt::format("a time limit of {} s: must be more than 0", execution.time_limit_seconds)};
  }
  if (execution.packet_rays < kLeastPacketRays || execution.packet_rays > kMostPacketRays ||
      !std::has_single_bit(execution.packet_rays)) {
    return Error{ErrorCode::kUsage, fmt::format("packets of {} rays: expected a power of two from {} to {}",
                                                execution.packet_rays, kLeastPacketRays, kMostPacketRays)};
  }
  return check_policies(execution);
}

/// How often a render with a preview goes over the whole picture before the order of tiles begins: until every pixel has
/// a sample where all pages fit in the cache. Else what is in flight would be spread over the whole scene all that time:
/// 2.4 % of a picture were done when 3.8 % are without a preview (terrain of 1 G triangles, 1920 x 1080, cap 1.5G, 25 s).
uint32_t coarse_levels(const MemoryPlan& plan) {
  constexpr uint32_t kLevelsOutOfCore = 3;
  return plan.cache_bytes >= plan.scene_page_bytes() ? SampleOrder::kAllLevels : kLevelsOutOfCore;
}

/// Samples a pixel at most. With a target for noise both halves have as many.
uint32_t most_samples(const PictureOptions& picture) {
  return picture.noise.asked() ? std::max(picture.samples & ~1u, 2u) : picture.samples;
}

/// Runs the orders over pass after pass. `samples`: of the first, is what context.samples names; of the last in the end.
void render_passes(RenderContext& context, PassPlan& passes, SampleOrder& samples, OrderRunner& orders) {
  const PictureOptions& picture = context.picture;
  for (;;) {
    orders.run(context);
    if (context.ended) return;
    context.end_pass();
    AdaptiveSampling* const adaptive = context.adaptive;
    if (adaptive != nullptr) {
      adaptive->end_pass(context.film, passes.done());
      if (adaptive->blocks().empty()) return;
      context.forecast.samples_total = context.samples_before + adaptive->expected_samples(most_samples(picture));
    }
    const double seconds = now_seconds() - context.start_seconds;
    const SampleSpan span = passes.next(seconds, adaptive != nullptr ? adaptive->drawn_pixels() : 1);
    if (span.count() == 0) return;
    if (adaptive != nullptr && !adaptive->whole_picture()) {
      samples = SampleOrder(picture.width, picture.height, span, adaptive->blocks());
    } else {
      samples = SampleOrder(picture.width, picture.height, span, picture.tile_sample);
    }
  }
}

/// Of the pixels that are rendered.
SampleReport report_samples(const RenderContext& context, uint64_t pixels, uint32_t passes_count) {
  SampleReport report{UINT32_MAX, 0, 0, 0, passes_count};
  uint64_t sum = 0;
  for (size_t pixel = 0; pixel < size_t{context.film.width()} * context.film.height(); ++pixel) {
    const uint32_t added = context.film.added(pixel);
    if (added == 0) continue;
    report.least = std::min(report.least, added), report.most = std::max(report.most, added);
    sum += added;
  }
  report.mean = static_cast<double>(sum) / static_cast<double>(pixels);
  report.drawn_mean = static_cast<double>(context.samples_before) / static_cast<double>(pixels);
  return report;
}

/// What a complete render of so many pixels leaves. Ends the preview, whose memory goes before that of the floats is taken.
RenderResult finish_result(RenderContext& context, const MemoryPlan& plan, uint64_t pixels,
                           std::optional<Preview>& preview) {
  const PictureOptions& picture = context.picture;
  RenderResult result;
  if (preview) {
    preview->show_if_none();
    result.first_picture = preview->first();
    result.previews_count = preview->shown_count();
    result.preview_seconds = preview->seconds();
    context.preview = nullptr;
    preview.reset();
  }
  result.rgba = context.film.resolve();
  if (context.aovs != nullptr) result.layers = context.aovs->resolve(context.film);
  result.counters = context.counters;
  result.plan = plan;
  result.threads = context.threads;
  result.picture_share =
      static_cast<double>(pixels) / (static_cast<double>(picture.width) * picture.height);
  result.peak_cache_bytes = context.cache.peak_resident_bytes();
  result.read_backend = context.cache.read_backend();
  return result;
}

/// Ends the clocks of a render that began at `start_ticks`: both clocks saw the same time.
void take_times(RenderContext& context, uint64_t start_ticks, RenderResult& result) {
  const uint64_t ticks = now_ticks();
  result.seconds = now_seconds() - context.start_seconds;
  for (PhaseClock& clock : context.phases) clock.settle(ticks);
  const uint64_t elapsed = std::max<uint64_t>(ticks - start_ticks, 1);
  result.phases = phase_times(context.phases, result.seconds / static_cast<double>(elapsed));
}

}  // namespace

std::string_view order_name(Order order) {
  switch (order) {
    case Order::kAuto: return "auto";
    case Order::kQueued: return "queued";
    case Order::kDepthFirst: return "depth-first";
    case Order::kSorted: return "sorted";
    case Order::kHybrid: return "hybrid";
    case Order::kPacket: return "packet";
    case Order::kPacketReorder: return "packet-reorder";
    case Order::kStream: return "stream";
    case Order::kDepthFirstWhileWhile: return "depth-first-while-while";
    case Order::kDepthFirstIfIf: return "depth-first-if-if";
  }
  return "";
}

Status check_picture(const PictureOptions& picture) {
  if (picture.width == 0 || picture.height == 0 || picture.width > 65536 || picture.height > 65536 ||
      uint64_t{picture.width} * picture.height >= (1ull << 31)) {
    return Error{ErrorCode::kUsage, fmt::format("a picture of {} x {} pixels: each side must be 1 to 65536, the area "
                                                "below 2^31", picture.width, picture.height)};
  }
  if (picture.samples == 0 || picture.samples > (1u << 22)) {
    return Error{ErrorCode::kUsage, fmt::format("{} samples a pixel: must be 1 to {}", picture.samples, 1u << 22)};
  }
  const ShadingOptions& shading = picture.shading;
  for (const float limit : {shading.clamp_direct, shading.clamp_indirect}) {
    if (!(limit >= 0) || std::isinf(limit)) {
      return Error{ErrorCode::kUsage, fmt::format("contributions clamped to {}: must be a number >= 0", limit)};
    }
  }
  if (picture.tile_sample == 0) {
    return Error{ErrorCode::kUsage, "one in 0 tiles: must be at least one in 1"};
  }
  return {};
}

Result<RenderResult> render(FileSystem& fs, const Scene& scene, const PictureOptions& picture,
                            const ExecutionOptions& asked, const RenderHooks& hooks) {
  const double start = now_seconds();
  const uint64_t start_ticks = now_ticks();
  SHOAL_RETURN_IF_ERROR(check_options(scene, picture, asked));
  ExecutionOptions execution = asked;
  if (execution.threads == 0) execution.threads = std::max(1u, std::thread::hardware_concurrency());
  SHOAL_ASSIGN_OR_RETURN(std::unique_ptr<ShadingTables> tables, ShadingTables::create(fs, scene, picture.shading,
                                                                                        execution.threads));
  SHOAL_ASSIGN_OR_RETURN(MemoryPlan plan, plan_memory(scene, *tables, picture, execution));
  execution.paging.read_depth = plan.read_depth;
  if (hooks.planned) hooks.planned(plan);

  const CameraRecord seen_by = camera_record(scene, picture);
  const bool lens = (picture.shading.effects.off & kEffectLens) == 0;
  const Camera camera(seen_by, picture.width, picture.height, lens ? picture.lens : pinhole(picture.lens),
                      camera_keys(scene, seen_by, picture.shading.effects));
  const bool previewed = !execution.preview.path.empty();
  const bool asked_noise = picture.noise.asked();
  PassPlan passes(most_samples(picture), execution.time_limit_seconds, asked_noise);
  SampleOrder samples(picture.width, picture.height, passes.next(now_seconds() - start), picture.tile_sample,
                      previewed ? coarse_levels(plan) : 0);
  const Sampler sampler(picture.shading.sampler, picture.shading.seed, picture.width, picture.height, most_samples(picture),
                        asked_noise ? SampleSets::kHalves : SampleSets::kOne);
  const uint64_t pixels = samples.pixel_count();
  Film film(picture.width, picture.height, asked_noise ? 2 : 1);
  std::optional<AdaptiveSampling> adaptive;
  if (asked_noise) {
    adaptive.emplace(picture.width, picture.height, picture.noise, execution.threads);
    passes.begins_with(pixels);
  }
  std::unique_ptr<AovFilm> aovs;
  if (!picture.aovs.empty()) {
    SHOAL_ASSIGN_OR_RETURN(aovs, AovFilm::create(picture.aovs, picture.width, picture.height, *scene.file));
  }
  std::optional<Preview> preview;
  if (previewed) preview.emplace(fs, execution.preview, film, samples, execution.threads, start, hooks.warning);
  OrderRunner orders(scene, execution, plan, samples.count());
  PageCache cache(*scene.file, plan.cache_bytes,
                  [&scene](const PageRecord& record, std::span<const std::byte> bytes) {
                    return check_page(scene, record, bytes);
                  },
                  orders.waiting_work(), execution.paging);
  if (execution.mapped_pages != nullptr) cache.serve_from(execution.mapped_pages);
  RenderContext context{scene, picture, *tables, camera, samples, sampler, hooks, cache, film, execution.threads};
  context.start_seconds = start;
  context.phases.assign(execution.threads, PhaseClock(start_ticks));
  if (preview) context.preview = &*preview;
  context.aovs = aovs.get();
  if (adaptive) context.adaptive = &*adaptive;
  context.forecast = {asked_noise ? 0 : pixels * picture.samples, execution.time_limit_seconds};
  context.forecast.mark(0, now_seconds() - start);
  render_passes(context, passes, samples, orders);
  orders.release();
  cache.finish_loads();
  SHOAL_RETURN_IF_ERROR(context.error);
  add_cache_counters(cache.background_counters(), context.counters);
  SHOAL_RETURN_IF_ERROR(check_identities(context.counters, context.samples_before));
  RenderResult result = finish_result(context, plan, pixels, preview);
  result.order = orders.chosen();
  result.samples = report_samples(context, pixels, passes.passes_count());
  if (adaptive) result.noise = adaptive->finish(film, result.standard_errors);
  take_times(context, start_ticks, result);
  return result;
}

}  // namespace shoal
