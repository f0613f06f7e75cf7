// Rendering: options, the plan for memory, and the two orders over the same treelets, pages and kernels.
// Called by bins and tests. The picture depends on the scene and on PictureOptions only; everything in
// ExecutionOptions changes time and traffic, never a bit.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "engine/counters.h"
#include "engine/scene.h"
#include "engine/shade.h"
#include "io/page_loader.h"
#include "io/result.h"
#include "queues/drain_policy.h"

namespace shoal {

struct PictureOptions {
  uint32_t width = 512, height = 512;
  uint32_t samples = 16;
  uint32_t camera = 0;  ///< index among the scene's cameras; a scene without one is framed
  uint32_t tile_sample = 1;  ///< for measuring: one in so many 32 x 32 tiles is rendered, the others stay black
  ShadingOptions shading;
};

enum class Order : uint8_t { kQueued, kDepthFirst };

struct ExecutionOptions {
  Order order = Order::kQueued;
  unsigned threads = 0;             ///< 0: all
  uint64_t max_memory_bytes = 0;    ///< of the whole process; 0: 70 % of the smaller of memory and cgroup limit
  uint64_t page_cache_bytes = 0;    ///< 0: from the plan
  uint64_t rays_in_flight = 0;      ///< 0: from the plan; rounded up to one block
  std::string policy = "resident-first";
  PolicyOptions policy_options;
  const MappedPages* mapped_pages = nullptr;  ///< for measuring depth-first: serves all pages, not the page cache
  PagingOptions paging;             ///< queued only: depth-first reads what it needs when it needs it
};

/// Where the memory of a render goes; made before anything is allocated, printed before work starts.
struct MemoryPlan {
  uint64_t cap_bytes = 0;
  uint64_t process_bytes = 0;   ///< resident before: program, libraries, scene tables, shading tables
  uint64_t film_bytes = 0;      ///< sums, and the picture while it is written
  uint64_t paths_bytes = 0;     ///< path states, their rays, queues
  uint64_t cache_bytes = 0;     ///< pages of geometry, attributes and textures
  uint64_t scratch_bytes = 0;   ///< stacks, read buffers, the cache's bookkeeping, the allocator's slack
  uint32_t paths_in_flight = 0;
  uint64_t scene_page_bytes = 0;  ///< all pages decoded: what the cache would hold if it could

  uint64_t total_bytes() const {
    return process_bytes + film_bytes + paths_bytes + cache_bytes + scratch_bytes;
  }
};

/// Fails with: kMemoryCap (the message names the smallest cap that would work), kUsage.
Result<MemoryPlan> plan_memory(const Scene& scene, const PictureOptions& picture, const ExecutionOptions& execution);

struct RenderProgress {
  uint64_t samples_done = 0, samples_total = 0;
  uint64_t disk_read_bytes = 0;
  double seconds = 0;
};

struct RenderHooks {
  std::function<void(const MemoryPlan&)> planned;       ///< may be empty; called once, before work starts
  std::function<void(const RenderProgress&)> progress;  ///< may be empty; now and then, one call at a time
  const std::atomic<bool>* stop = nullptr;              ///< ends the render with kStopped when it becomes true
};

struct RenderResult {
  std::vector<float> rgba;  ///< width * height * 4
  RenderCounters counters;
  MemoryPlan plan;
  double seconds = 0;
  unsigned threads = 0;
  uint64_t peak_cache_bytes = 0;
  double picture_share = 1;  ///< of the pixels, that were rendered (PictureOptions::tile_sample)
};

/// Renders and checks the counters' identities. Fails with: kInternal (they do not balance), kCorrupt, kStorage,
/// kMemoryCap, kStopped, kInput (environment).
Result<RenderResult> render(FileSystem& fs, const Scene& scene, const PictureOptions& picture,
                            const ExecutionOptions& execution, const RenderHooks& hooks = {});

}  // namespace shoal
