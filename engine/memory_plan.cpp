#include "engine/memory_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <thread>

#include "engine/adaptive_sampling.h"
#include "engine/aov_film.h"
#include "engine/film.h"
#include "engine/streamed_paths.h"
#include "engine/light_sampler.h"
#include "engine/path_ray.h"
#include "engine/preview.h"
#include "engine/process_memory.h"
#include "engine/queued_paths.h"
#include "engine/render.h"
#include "engine/render_record.h"
#include "engine/sorted_paths.h"
#include "engine/split_memory.h"
#include "io/image.h"
#include "io/page_cache.h"

namespace shoal {
namespace {

constexpr uint64_t kMiB = 1ull << 20;
constexpr uint32_t kMinimumPaths = 512;  ///< chosen: eight full blocks
/// What the process grows by while it renders, beside what is planned: code and libraries touched for the first time,
/// threads of oneTBB, the allocator's slack, the report. Seen: 3 to 5 MiB.
constexpr uint64_t kProcessGrowthBytes = 8 * kMiB;
/// A thread: its stack, the block in hand, counters.
constexpr uint64_t kThreadBytes = 1 * kMiB;
/// A treelet in engine/treelet_scheduler: what usually waits for it, and its row in a decision, in a vector that grows.
constexpr uint64_t kSchedulerTreeletBytes = sizeof(uint32_t) + 3 * sizeof(WaitingTreelet) + 2 * sizeof(PageId);
/// Of what is left after everything fixed, the part that reads ahead may take for their buffers: chosen. With fewer
/// than 4 reads at once the threads read for themselves.
constexpr uint64_t kReadAheadShare = 16;
constexpr unsigned kLeastReadDepth = 4;
/// Shading tables of any scene: directional albedo, structures.
constexpr uint64_t kSmallTableBytes = 256 * 1024;
constexpr uint64_t kLobeTableBytes = 1024 * 1024;  // engine/lobe_tables.h, for scenes with layers
/// Of samples and of the texts of a checkpoint; sums are written from where they are.
constexpr uint64_t kCheckpointBlockBytes = 2 * kMiB;
constexpr uint64_t kFloatPixelBytes = 4 * sizeof(float);

/// What is known of a scene before or after its tables are read.
struct SceneSizes {
  const PageFile& file;
  uint32_t treelet_count = 0;
  uint64_t process_bytes = 0, top_tree_bytes = 0, table_bytes = 0;
  uint64_t reading_bytes = 0;  ///< beside what stays, for a while, when the tables are read
};

struct PageSizes {
  uint64_t sum[256] = {};    ///< by kind, decoded
  uint64_t largest = kPageAlignment;
};

PageSizes page_sizes(const PageFile& file) {
  PageSizes sizes;
  for (const PageRecord& record : file.records()) {
    if (record.kind == PageKind::kTable) continue;
    sizes.sum[static_cast<uint8_t>(record.kind)] += (record.raw_bytes + 64ull + 4095) / 4096 * 4096;
    sizes.largest = std::max<uint64_t>(sizes.largest, record.raw_bytes);
  }
  return sizes;
}

uint64_t bytes_of_kind(const PageSizes& sizes, PageKind kind) { return sizes.sum[static_cast<uint8_t>(kind)]; }

std::string in_mib(uint64_t bytes) { return fmt::format("{} MiB", (bytes + kMiB - 1) / kMiB); }

/// Everything that does not depend on how the rest is split.
MemoryPlan fixed_parts(const SceneSizes& scene, const PictureOptions& picture, const ExecutionOptions& execution,
                       unsigned threads) {
  const uint64_t pixels = uint64_t{picture.width} * picture.height;
  const PageSizes pages = page_sizes(scene.file);
  MemoryPlan plan;
  plan.cap_bytes = execution.max_memory_bytes;
  if (plan.cap_bytes == 0) plan.cap_bytes = default_cap_bytes();
  plan.process_bytes = scene.process_bytes;
  plan.top_tree_bytes = scene.top_tree_bytes;
  plan.table_bytes = scene.table_bytes;
  // The sums and the resolved floats; the sums are gone before files are written from copies of the floats.
  const bool adaptive = picture.noise.asked();
  plan.film_bytes = Film::bytes(picture.width, picture.height, adaptive ? 2 : 1) + pixels * kFloatPixelBytes;
  if (adaptive) plan.noise_bytes = AdaptiveSampling::bytes(picture.width, picture.height);
  if (!execution.preview.path.empty()) plan.preview_bytes = Preview::bytes(picture.width, picture.height);
  if (!execution.checkpoint.path.empty()) {
    plan.checkpoint_bytes = kCheckpointBlockBytes + execution.checkpoint.unfinished_count * sizeof(UnfinishedSample);
  }
  plan.aov_bytes = AovFilm::bytes(picture.aovs, picture.width, picture.height, scene.file);
  plan.read_buffer_bytes = threads * (pages.largest + 2 * kPageAlignment);  // direct reads need their own
  plan.scratch_bytes = kProcessGrowthBytes + threads * kThreadBytes +
                       PageCache::overhead_bytes(scene.file, PagingOptions{.read_depth = 0}) +
                       scene.file.page_count() * sizeof(TreeletId) + scene.treelet_count * kSchedulerTreeletBytes;
  if (execution.record != nullptr) plan.scratch_bytes += RenderRecord::bytes(threads, execution.paging.read_depth);
  plan.geometry_page_bytes = bytes_of_kind(pages, PageKind::kTreelet);
  plan.attribute_page_bytes = bytes_of_kind(pages, PageKind::kAttributes);
  plan.texture_page_bytes = bytes_of_kind(pages, PageKind::kTexture);
  return plan;
}

/// As many reads ahead at once as were asked for and as fit.
unsigned read_depth_within(const PageFile& file, const PagingOptions& asked, uint64_t bytes) {
  unsigned depth = asked.read_depth;
  while (depth > 0 && PageLoader::buffer_bytes(file, {.read_depth = depth}) > bytes) depth = depth * 3 / 4;
  return depth < std::min(asked.read_depth, kLeastReadDepth) ? 0 : depth;
}

/// Of so many paths in flight and their rays. Of all orders that may be chosen, the most.
uint64_t waiting_bytes(Order order, uint32_t treelet_count, uint32_t paths, unsigned threads) {
  const uint64_t queued = QueuedPaths::bytes(treelet_count, paths, threads);
  const uint64_t sorted = SortedPaths::bytes(paths, threads);
  if (order == Order::kAuto) return std::max({queued, sorted, StreamedPaths::bytes(Order::kHybrid, treelet_count, threads)});
  return order == Order::kSorted ? sorted : queued;
}

/// `order`: of kAuto, all of them.
Result<MemoryPlan> share_out(Order order, const SceneSizes& scene, const PictureOptions& picture,
                             const ExecutionOptions& execution) {
  const bool queued = order == Order::kQueued || order == Order::kAuto;
  const bool waits = !is_depth_first(order) && !needs_every_page(order);
  const unsigned threads = execution.threads > 0 ? execution.threads : std::max(1u, std::thread::hardware_concurrency());
  const uint64_t samples = uint64_t{picture.width} * picture.height * picture.samples;
  MemoryPlan plan = fixed_parts(scene, picture, execution, threads);
  const uint64_t least_cache = PageCache::minimum_capacity_bytes(scene.file, threads);
  if (execution.page_cache_bytes > 0 && execution.page_cache_bytes < least_cache) {
    return Error{ErrorCode::kMemoryCap,
                 fmt::format("a page cache of {} bytes cannot hold the pages that {} threads need at once; the smallest "
                             "that works is {} bytes", execution.page_cache_bytes, threads, least_cache)};
  }
  const auto paths_bytes = [&](uint64_t paths) {
    return waits ? waiting_bytes(order, scene.treelet_count, static_cast<uint32_t>(paths), threads) : 0;
  };
  uint64_t asked_paths = std::min<uint64_t>((execution.rays_in_flight + 1) / 2, kMaxPathsInFlight);
  if (execution.rays_in_flight > 0) asked_paths = std::max<uint64_t>(asked_paths, kRaysPerBlock / 2);
  const uint64_t least_paths = asked_paths > 0 ? asked_paths : std::min<uint64_t>(kMinimumPaths, samples);
  uint64_t least_pages = std::max(least_cache, execution.page_cache_bytes);
  if (needs_every_page(order)) {
    least_pages = std::max(plan.scene_page_bytes(), execution.page_cache_bytes);
    plan.ray_bytes = StreamedPaths::bytes(order, scene.treelet_count, threads);
    if (execution.page_cache_bytes > 0 && execution.page_cache_bytes < plan.scene_page_bytes()) {
      return Error{ErrorCode::kMemoryCap,
                   fmt::format("a page cache of {} bytes cannot hold every page, as the {} order needs; the smallest "
                               "that works is {} bytes", execution.page_cache_bytes, order_name(order), least_pages)};
    }
  }

  const uint64_t fixed = plan.total_bytes();
  const uint64_t reading = plan.process_bytes + plan.top_tree_bytes + plan.table_bytes + scene.reading_bytes;
  const uint64_t smallest = std::max(reading, fixed + paths_bytes(least_paths) + least_pages);
  if (smallest > plan.cap_bytes) {
    return Error{ErrorCode::kMemoryCap,
                 fmt::format("the memory cap of {} cannot work for this scene and picture; the smallest that would is "
                             "about {}", in_mib(plan.cap_bytes), in_mib(smallest + kMiB))};
  }
  uint64_t left = plan.cap_bytes - (fixed - plan.paths_bytes());
  if (queued) {
    const uint64_t room = std::min(left / kReadAheadShare, plan.cap_bytes - smallest);
    plan.read_depth = read_depth_within(scene.file, execution.paging, room);
    const uint64_t buffers = PageLoader::buffer_bytes(scene.file, {.read_depth = plan.read_depth});
    plan.read_buffer_bytes += buffers;
    left -= buffers;
  }
  uint64_t paths = asked_paths;
  if (paths == 0 && waits) {
    paths = choose_paths_in_flight({left, plan.scene_page_bytes(), scene.treelet_count, least_pages, least_paths,
                                    std::min<uint64_t>(samples, kMaxPathsInFlight), paths_bytes});
  }
  plan.paths_in_flight = static_cast<uint32_t>(waits ? paths : threads);
  if (needs_every_page(order)) plan.paths_in_flight = threads * StreamedPaths::paths_of(order);
  if (waits) {
    plan.path_state_bytes = order == Order::kSorted
                                ? SortedPaths::state_bytes(plan.paths_in_flight)
                                : QueuedPaths::state_bytes(scene.treelet_count, plan.paths_in_flight);
    plan.ray_bytes = paths_bytes(paths) - plan.path_state_bytes;
  }
  plan.cache_bytes = std::min(left - plan.paths_bytes(), std::max(plan.scene_page_bytes(), least_cache));
  if (execution.page_cache_bytes > 0) plan.cache_bytes = execution.page_cache_bytes;
  return plan;
}

/// What may be chosen is planned as the queued order, which is what runs where pages do not fit; with room for every order
/// where all fit beside every page.
Result<MemoryPlan> share_out(const SceneSizes& scene, const PictureOptions& picture, const ExecutionOptions& execution) {
  if (execution.order != Order::kAuto) return share_out(execution.order, scene, picture, execution);
  SHOAL_ASSIGN_OR_RETURN(const MemoryPlan queued, share_out(Order::kQueued, scene, picture, execution));
  Result<MemoryPlan> all = share_out(Order::kAuto, scene, picture, execution);
  if (!all.ok() || all.value().cache_bytes < all.value().scene_page_bytes()) return queued;
  all.value().every_order_fits = true;
  return all;
}

/// Decoded size of a table; one that is absent is found out when it is read.
uint64_t size_of(const PageFile& file, TableId table) {
  const auto bytes = file.table_bytes(table, UINT64_MAX);
  return bytes.ok() ? bytes.value() : 0;
}

}  // namespace

uint64_t decoded_page_bytes(const PageFile& file) {
  const PageSizes sizes = page_sizes(file);
  return std::accumulate(std::begin(sizes.sum), std::end(sizes.sum), uint64_t{0});
}

Result<MemoryPlan> plan_memory(const Scene& scene, const ShadingTables& tables, const PictureOptions& picture,
                               const ExecutionOptions& execution) {
  SceneSizes sizes{*scene.file};
  sizes.treelet_count = static_cast<uint32_t>(scene.treelets.size());
  sizes.top_tree_bytes = scene.top_tree.resident_bytes();
  sizes.table_bytes = scene.resident_bytes() - sizes.top_tree_bytes + tables.resident_bytes();
  const uint64_t known = sizes.top_tree_bytes + sizes.table_bytes;
  sizes.process_bytes = execution.process_bytes;
  if (sizes.process_bytes == 0) sizes.process_bytes = resident_set_bytes() - std::min(known, resident_set_bytes());
  return share_out(sizes, picture, execution);
}

Result<MemoryPlan> plan_before_tables(FileSystem& fs, const PageFile& file, const PictureOptions& picture,
                                      const ExecutionOptions& execution, uint64_t kept_bytes) {
  SHOAL_RETURN_IF_ERROR(check_picture(picture));
  SceneSizes sizes{file};
  sizes.treelet_count = static_cast<uint32_t>(size_of(file, tables::kTreelets) / sizeof(TreeletPages));
  for (const TableId table : {tables::kTopNodes, tables::kEntries, tables::kInstances}) {
    sizes.top_tree_bytes += size_of(file, table);
  }
  for (const TableId table : {tables::kBuildRecord, tables::kSceneHeader, tables::kTreelets, tables::kMaterials,
                              tables::kTextures, tables::kEmitters, tables::kLights, tables::kCameras, tables::kNames,
                              tables::kSourceFiles, tables::kMaterialLayers, tables::kTextureTransforms,
                              tables::kCameraKeys}) {
    sizes.table_bytes += size_of(file, table);
  }
  const uint64_t emitters = size_of(file, tables::kEmitters) / sizeof(Emitter);
  const uint64_t entries = size_of(file, tables::kEntries) / sizeof(TreeletEntry);
  const uint64_t directory = file.records().size_bytes();
  const LightSampler::Bytes lights =
      LightSampler::bytes_at_most(emitters, size_of(file, tables::kLights) / sizeof(PunctualLight));
  sizes.table_bytes += directory + entries * sizeof(uint32_t) + lights.resident + kSmallTableBytes;
  const bool layers = size_of(file, tables::kMaterialLayers) > 0 || (picture.shading.effects.on & kLayerEffects) != 0;
  if (layers) sizes.table_bytes += kLobeTableBytes;
  if ((picture.shading.effects.off & kMaterialSceneEffects) != 0) {  // copies, engine/shaded_materials.h
    sizes.table_bytes += size_of(file, tables::kMaterials) + size_of(file, tables::kMaterialLayers);
  }
  sizes.reading_bytes = std::max<uint64_t>(kTablePageBytes + 2 * kPageAlignment, lights.making);
  const EnvironmentOptions& environment = picture.shading.environment;
  const bool shown = (picture.shading.effects.off & kEffectEnvironment) == 0;
  if (environment.kind == EnvironmentOptions::Kind::kImage && shown) {
    SHOAL_ASSIGN_OR_RETURN(const HdrImageSize image,
                           hdr_image_size(fs, environment.path, kMaxEnvironmentPixels));
    // Its distribution: a number a pixel, a few words a row.
    const uint64_t distribution = uint64_t{image.height} * (image.width * sizeof(double) + 128);
    sizes.table_bytes += image.kept_bytes + distribution;
    sizes.reading_bytes = std::max(sizes.reading_bytes, image.peak_bytes - image.kept_bytes);
  }
  const uint64_t resident = resident_set_bytes();
  sizes.process_bytes = resident - std::min(directory, resident) + kept_bytes;
  return share_out(sizes, picture, execution);
}

}  // namespace shoal
