#include "engine/render.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <thread>

#include "engine/adaptive_sampling.h"
#include "engine/aov_film.h"
#include "engine/checkpoint.h"
#include "engine/clock.h"
#include "engine/order_runner.h"
#include "engine/picture_attributes.h"
#include "engine/preview.h"
#include "engine/render_beginning.h"
#include "engine/render_record.h"
#include "engine/render_report.h"
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
    return Error{ErrorCode::kUsage, fmt::format("--packet-size {}: expected a power of two from {} to {}",
                                                execution.packet_rays, kLeastPacketRays, kMostPacketRays)};
  }
  if (execution.time_limit_seconds > 0 && picture.range.count() > 0) {
    return Error{ErrorCode::kUsage, "a range of samples with a time limit: it must be complete"};
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
    const double seconds = context.seconds_before + now_seconds() - context.start_seconds;
    const SampleSpan span = passes.next(seconds, adaptive != nullptr ? adaptive->drawn_pixels() : 1);
    if (span.count() == 0) return;
    samples = order_of(picture, span, adaptive, 0);
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

/// What a complete render of so many pixels leaves; `resolved`: the picture as well. Ends the preview, whose memory goes before that of the floats is taken.
RenderResult finish_result(RenderContext& context, const MemoryPlan& plan, uint64_t pixels,
                           std::optional<Preview>& preview, bool resolved) {
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
  if (resolved) {
    result.rgba = context.film.resolve();
    if (context.aovs != nullptr) result.layers = context.aovs->resolve(context.film);
  }
  if (context.seconds_before > 0) result.resumed = ResumedFrom{context.samples_restored, context.seconds_before};
  result.counters = context.counters;
  result.plan = plan;
  result.threads = context.threads;
  result.picture_share =
      static_cast<double>(pixels) / (static_cast<double>(picture.width) * picture.height);
  result.peak_cache_bytes = context.cache.peak_resident_bytes();
  result.read_backend = context.cache.read_backend();
  return result;
}

/// Writes the sums of a complete render where they are asked for.
Status write_part(FileSystem& fs, const std::string& path, const std::string& identity, const RenderContext& context,
                  const PictureSums& sums) {
  if (path.empty()) return {};
  SumsHeader header = sums_header(context.picture, SumsKind::kPart);
  header.seconds = context.seconds_before + now_seconds() - context.start_seconds;
  const std::string attributes = attributes_text(described_image(context.scene, context.picture));
  return write_sums(fs, path, header, identity, attributes, sums, nullptr);
}

/// A picture of so many samples, with those of a render that this one goes on from.
void foretell(RenderContext& context, uint64_t samples, double limit_seconds) {
  context.forecast = {samples, limit_seconds};
  context.forecast.begins_with(context.samples_restored, context.seconds_before);
  context.forecast.mark(context.samples_restored, now_seconds() - context.start_seconds);
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
  if (picture.range.count() > 0 || picture.range.begin > 0) {
    const SampleSpan& range = picture.range;
    if (range.begin >= range.end || range.end > picture.samples) {
      return Error{ErrorCode::kUsage, fmt::format("samples {} to {} of {}: the first must be less than the last, which is not "
                                                  "among them and at most as many as the picture has",
                                                  range.begin, range.end, picture.samples)};
    }
    if (picture.noise.asked()) {
      return Error{ErrorCode::kUsage, "a range of samples with a target for noise: which are drawn depends on all before"};
    }
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
  SHOAL_ASSIGN_OR_RETURN(RenderBeginning beginning, RenderBeginning::find(fs, scene, picture, execution));
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
  const SampleSpan range = asked_range(picture);
  SHOAL_ASSIGN_OR_RETURN(RenderSums sums, RenderSums::create(scene, picture, execution.threads));
  PassPlan passes(range.end, execution.time_limit_seconds, picture.noise.asked(), range.begin);
  SHOAL_ASSIGN_OR_RETURN(const uint32_t levels,
                         beginning.first_pass(sums.all(), passes, previewed ? coarse_levels(plan) : 0, now_seconds() - start));
  const uint64_t pixels = order_of(picture, passes.state().span, nullptr, 0).pixel_count();
  if (!beginning.earlier && sums.adaptive) passes.begins_with(pixels);
  SampleOrder samples = order_of(picture, passes.state().span, sums.all().adaptive, levels);
  const Sampler sampler(picture.shading.sampler, picture.shading.seed, picture.width, picture.height, most_samples(picture),
                        sums.adaptive ? SampleSets::kHalves : SampleSets::kOne);
  std::optional<Preview> preview;
  if (previewed) preview.emplace(fs, execution.preview, sums.film, samples, execution.threads, start, hooks.warning);
  OrderRunner orders(scene, execution, plan, samples.count() - beginning.done_in_pass());
  PageCache cache(*scene.file, plan.cache_bytes,
                  [&scene](const PageRecord& record, std::span<const std::byte> bytes) {
                    return check_page(scene, record, bytes);
                  },
                  orders.waiting_work(), execution.paging);
  if (execution.mapped_pages != nullptr) cache.serve_from(execution.mapped_pages);
  RenderContext context{scene, picture, *tables, camera, samples, sampler, hooks, cache, sums.film, execution.threads};
  context.start_seconds = start;
  context.phases.assign(execution.threads, PhaseClock(start_ticks));
  if (preview) context.preview = &*preview;
  context.aovs = sums.aovs.get();
  context.adaptive = sums.all().adaptive;
  context.touches = execution.touches;
  SHOAL_RETURN_IF_ERROR(beginning.begin(context));
  SumsHeader header = sums_header(picture, SumsKind::kCheckpoint);
  header.coarse_levels = levels;
  std::optional<Checkpoints> checkpoints;
  if (!execution.checkpoint.path.empty()) {
    context.checkpoints = &checkpoints.emplace(fs, execution.checkpoint, beginning.identity, header, passes, sums.all(),
                                               hooks.warning);
  }
  context.record = execution.record;
  const RecordedScope recorded(context.record, context.phases);  // of a beginning that fails, too
  if (context.record != nullptr) {
    SHOAL_RETURN_IF_ERROR(context.record->begin(scene, orders.page_treelets(), cache, execution.threads,
                                                plan.read_depth, start_ticks, start));
  }
  foretell(context, sums.adaptive ? 0 : pixels * range.count(), execution.time_limit_seconds);
  render_passes(context, passes, samples, orders);
  orders.release();
  cache.finish_loads();
  SHOAL_RETURN_IF_ERROR(context.error);
  add_cache_counters(cache.background_counters(), context.counters);
  SHOAL_RETURN_IF_ERROR(check_identities(context.counters, context.samples_before - context.samples_restored));
  SHOAL_RETURN_IF_ERROR(write_part(fs, execution.sums_path, beginning.identity, context, sums.all()));
  RenderResult result = finish_result(context, plan, pixels, preview, execution.sums_path.empty());
  result.order = orders.chosen();
  result.samples = report_samples(context, pixels, passes.passes_count());
  if (sums.adaptive) result.noise = sums.adaptive->finish(sums.film, result.standard_errors);
  take_times(context, start_ticks, result);
  return result;
}

}  // namespace shoal
