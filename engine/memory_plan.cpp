#include <algorithm>

#include <fmt/format.h>

#include "engine/film.h"
#include "engine/path_ray.h"
#include "engine/process_memory.h"
#include "engine/queued_paths.h"
#include "engine/render.h"
#include "io/page_cache.h"

namespace shoal {
namespace {

constexpr uint64_t kMiB = 1ull << 20;
/// Paths beyond this many in flight were not seen to pay in memory; out of core the share below decides.
constexpr uint32_t kDefaultPaths = 1u << 19;
constexpr uint32_t kMinimumPaths = 512;  ///< chosen: eight full blocks
/// Of what is left after everything fixed, the part that rays in flight may take when pages do not all fit: chosen, not
/// yet measured.
constexpr double kPathShare = 0.25;

uint64_t all_page_bytes(const PageFile& file) {
  uint64_t sum = 0;
  for (const PageRecord& record : file.records()) {
    if (record.kind != PageKind::kTable) sum += (record.raw_bytes + 64ull + 4095) / 4096 * 4096;
  }
  return sum;
}

uint64_t largest_page_bytes(const PageFile& file) {
  uint64_t largest = kPageAlignment;
  for (const PageRecord& record : file.records()) {
    if (record.kind != PageKind::kTable) largest = std::max<uint64_t>(largest, record.raw_bytes);
  }
  return largest;
}

std::string in_mib(uint64_t bytes) { return fmt::format("{} MiB", (bytes + kMiB - 1) / kMiB); }

}  // namespace

Result<MemoryPlan> plan_memory(const Scene& scene, const PictureOptions& picture, const ExecutionOptions& execution) {
  const bool queued = execution.order == Order::kQueued;
  const unsigned threads = execution.threads;
  const uint32_t treelets = static_cast<uint32_t>(scene.treelets.size());
  const uint64_t pixels = uint64_t{picture.width} * picture.height;
  const uint64_t samples = pixels * picture.samples;

  MemoryPlan plan;
  plan.cap_bytes = execution.max_memory_bytes;
  if (plan.cap_bytes == 0) plan.cap_bytes = memory_limit_bytes() / 10 * 7;
  plan.process_bytes = resident_set_bytes();
  // The sums and the resolved floats; the sums are gone before files are written from copies of the floats.
  plan.film_bytes = Film::bytes(picture.width, picture.height) + pixels * 4 * sizeof(float);
  // A thread: its stack, the block in hand, a page (direct reads need their own buffer).
  plan.scratch_bytes = 8 * kMiB + threads * (1 * kMiB + largest_page_bytes(*scene.file) + 2 * kPageAlignment) +
                       PageCache::overhead_bytes(*scene.file, queued ? execution.paging : PagingOptions{.read_depth = 0}) +
                       scene.file->page_count() * sizeof(TreeletId);
  plan.scene_page_bytes = all_page_bytes(*scene.file);
  const uint64_t least_cache = PageCache::minimum_capacity_bytes(*scene.file, threads);

  const auto paths_bytes = [&](uint64_t paths) {
    return queued ? QueuedPaths::bytes(treelets, static_cast<uint32_t>(paths), threads) : 0;
  };
  uint64_t asked_paths = std::min<uint64_t>((execution.rays_in_flight + 1) / 2, kMaxPathsInFlight);
  if (execution.rays_in_flight > 0) asked_paths = std::max<uint64_t>(asked_paths, kRaysPerBlock / 2);
  const uint64_t least_paths = asked_paths > 0 ? asked_paths : std::min<uint64_t>(kMinimumPaths, samples);

  const uint64_t fixed = plan.process_bytes + plan.film_bytes + plan.scratch_bytes;
  const uint64_t least_pages = std::max(least_cache, execution.page_cache_bytes);
  // Reading tables and an environment may have taken more for a while than stays resident: a cap is for the whole run.
  const uint64_t peak = execution.max_memory_bytes > 0 ? peak_resident_set_bytes() : 0;
  const uint64_t smallest = std::max(peak, fixed + paths_bytes(least_paths) + least_pages);
  if (execution.page_cache_bytes > 0 && execution.page_cache_bytes < least_cache) {
    return Error{ErrorCode::kMemoryCap,
                 fmt::format("a page cache of {} bytes cannot hold the pages that {} threads need at once; the smallest "
                             "that works is {} bytes", execution.page_cache_bytes, threads, least_cache)};
  }
  if (smallest > plan.cap_bytes) {
    return Error{ErrorCode::kMemoryCap,
                 fmt::format("the memory cap of {} cannot work for this scene and picture; the smallest that would is "
                             "about {}", in_mib(plan.cap_bytes), in_mib(smallest + kMiB))};
  }

  const uint64_t left = plan.cap_bytes - fixed;
  const uint64_t most_paths = std::min<uint64_t>({kDefaultPaths, samples, kMaxPathsInFlight});
  uint64_t paths = std::max(least_paths, most_paths);
  if (asked_paths > 0) {
    paths = asked_paths;
  } else if (plan.scene_page_bytes + paths_bytes(paths) > left) {
    const uint64_t share = std::min<uint64_t>(static_cast<uint64_t>(kPathShare * static_cast<double>(left)),
                                              left - least_pages);
    while (paths > least_paths && paths_bytes(paths) > share) paths = std::max(least_paths, paths * 7 / 8);
  }
  plan.paths_in_flight = static_cast<uint32_t>(queued ? paths : threads);
  plan.paths_bytes = paths_bytes(paths);
  plan.cache_bytes = std::min(left - plan.paths_bytes, std::max(plan.scene_page_bytes, least_cache));
  if (execution.page_cache_bytes > 0) plan.cache_bytes = execution.page_cache_bytes;
  return plan;
}

}  // namespace shoal
