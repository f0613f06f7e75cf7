// How a memory cap is shared out before a scene is built. Every part is an upper bound of what is taken later; the
// phases (textures, streaming, building a chunk) take turns in what the resident parts leave.
// Called by engine/build_scene. Pure: what the file will look like depends on the scene, the options and the cap, not on
// the number of threads or on what the process holds. Cost: nothing.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/file.h"
#include "io/result.h"
#include "treelets/bvh_builder_kind.h"
#include "treelets/triangle_soup.h"

namespace shoal {

/// What the plan has to know of a scene.
struct BuildMemoryNeeds {
  struct Object {
    uint64_t triangles = 0;
    CornerLayout layout;
  };
  uint64_t document_bytes = 0;  ///< resident while building
  std::vector<Object> objects;
  uint64_t instances = 0, emitters = 0;  ///< at most
  uint64_t coverage_bytes = 0;           ///< alpha of all levels that are kept
  uint64_t image_bytes = 0;              ///< while the largest image is tiled
  uint64_t decompress_bytes = 0;         ///< while the largest compressed view or mesh is decoded, before all else
  uint64_t pose_bytes = 0;               ///< pose_bytes(): resident while building
  uint32_t pose_windows = 0;             ///< of the primitive that is morphed or skinned by most accessors
  uint32_t treelet_bytes = 0;
  bool positions_on_grid = false;        ///< --positions other than exact
  BvhBuilder builder = BvhBuilder::kSah;
  unsigned threads = 1;
  uint64_t forced_chunk_triangles = 0;   ///< 0: from the plan
};

struct BuildMemoryPlan {
  uint64_t cap_bytes = 0;
  uint64_t process_bytes = 0, document_bytes = 0, tables_bytes = 0, coverage_bytes = 0, writing_bytes = 0;
  uint64_t chunk_bytes = 0;          ///< one chunk while it is built, with the records of the next
  uint64_t pages_bytes = 0;          ///< pages in flight while it is
  uint32_t pages_in_flight = 0;
  uint64_t reading_bytes = 0;        ///< lanes, while triangles stream by
  uint32_t lanes = 0;
  uint64_t buffers_bytes = 0;        ///< grid, then write buffers of the chunks, beside the lanes
  unsigned threads = 1;
  uint64_t threads_bytes = 0;        ///< stacks, and staging of reads that are not aligned
  uint64_t forced_chunk_triangles = 0;
  BvhBuilder builder = BvhBuilder::kSah;

  /// What is left for an image while it is tiled.
  uint64_t image_bytes() const;
  /// Triangles that may be built at once.
  uint64_t chunk_triangles(const CornerLayout& layout) const;
  /// Cells to count an object's triangles into.
  uint32_t grid_cells(uint64_t triangles) const;
  /// Of each of so many chunks; a multiple of kBlockBytes.
  uint64_t write_buffer_bytes(uint64_t chunks) const;
};

/// Fails with: kMemoryCap (the message names the smallest cap that works).
Result<BuildMemoryPlan> plan_build_memory(const BuildMemoryNeeds& needs, uint64_t cap_bytes, const std::string& path);

/// What reading the JSON of a scene takes at its peak, counted from its bytes, at most.
Result<uint64_t> document_bytes(FileSystem& fs, const std::string& path);
/// Refuses a document that cannot be read within the cap. Small ones are read in any case: the plan names the cap then.
Status check_document(uint64_t bytes, uint64_t cap_bytes, const std::string& path);
/// Refuses more instances than can be listed within the cap, before they are. Fails with: kMemoryCap.
Status check_instances(uint64_t instances, uint64_t document_bytes, uint64_t cap_bytes, const std::string& path);

}  // namespace shoal
