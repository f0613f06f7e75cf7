// One budget for the rendering process: the plan that shares the memory cap out, made before memory is taken.
//
// The parts: the process as it stands, the resident top tree, the other tables of the scene and of shading, the film,
// the preview, the rays in flight (path states, rays and their queues), the page cache (geometry, attributes and textures
// under one budget), read buffers, and scratch. What is left after everything fixed is split between rays in flight and
// page cache (engine/split_memory.h). A cap that cannot work is refused with the smallest that would.
// Called by engine/render and bins. Plain functions. Cost: one pass over the directory.
#pragma once

#include <cstdint>

#include "engine/scene.h"
#include "io/result.h"

namespace shoal {

struct PictureOptions;
struct ExecutionOptions;
class ShadingTables;

/// Where the memory of a render goes.
struct MemoryPlan {
  uint64_t cap_bytes = 0;
  uint64_t process_bytes = 0;      ///< resident before: program, libraries, allocator
  uint64_t top_tree_bytes = 0;     ///< nodes, entries and instances
  uint64_t table_bytes = 0;        ///< other tables of the scene, light distributions, environment
  uint64_t film_bytes = 0;         ///< sums, and the picture while it is written
  uint64_t preview_bytes = 0;      ///< --preview: its pixels, and the file before it is written
  uint64_t aov_bytes = 0;          ///< --aov: sums, and the layers while they are written
  uint64_t noise_bytes = 0;        ///< --target-noise: sums and judgements
  uint64_t checkpoint_bytes = 0;   ///< a block of it, and samples that begin again
  uint64_t path_state_bytes = 0;   ///< path states and the lists in which they wait
  uint64_t ray_bytes = 0;          ///< rays and their queues
  uint64_t cache_bytes = 0;        ///< pages of geometry, attributes and textures
  uint64_t read_buffer_bytes = 0;  ///< pages on their way from the disk
  uint64_t scratch_bytes = 0;      ///< stacks, the cache's bookkeeping, the allocator's slack
  uint32_t paths_in_flight = 0;
  bool every_order_fits = false;   ///< Order::kAuto: beside every page there is room for what each order needs
  unsigned read_depth = 0;         ///< reads ahead at once: at most PagingOptions::read_depth
  // All pages decoded: what the cache would hold if it could.
  uint64_t geometry_page_bytes = 0, attribute_page_bytes = 0, texture_page_bytes = 0;

  uint64_t scene_page_bytes() const { return geometry_page_bytes + attribute_page_bytes + texture_page_bytes; }
  uint64_t paths_bytes() const { return path_state_bytes + ray_bytes; }
  uint64_t total_bytes() const {
    return process_bytes + top_tree_bytes + table_bytes + film_bytes + preview_bytes + aov_bytes + noise_bytes +
           checkpoint_bytes + paths_bytes() + cache_bytes + read_buffer_bytes + scratch_bytes;
  }
};

/// All pages of geometry, attributes and textures decoded: what a cache would hold that could.
uint64_t decoded_page_bytes(const PageFile& file);

/// The plan of a render whose tables are in memory.
/// Fails with: kMemoryCap (the message names the smallest cap that would work).
Result<MemoryPlan> plan_memory(const Scene& scene, const ShadingTables& tables, const PictureOptions& picture,
                               const ExecutionOptions& execution);

/// The same before the tables are read, from the sizes in the directory and in the environment's header. Nothing is
/// larger afterwards than it says, so a cap that passes here passes plan_memory() too, given `process_bytes` of this
/// plan as ExecutionOptions::process_bytes. Fails with: kMemoryCap, kUsage (a picture of no size), kInput (environment).
/// `kept_bytes`: what the caller will hold beside this render.
Result<MemoryPlan> plan_before_tables(FileSystem& fs, const PageFile& file, const PictureOptions& picture,
                                      const ExecutionOptions& execution, uint64_t kept_bytes = 0);

}  // namespace shoal
