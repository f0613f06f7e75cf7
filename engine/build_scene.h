// glTF to .shoal: flattens the node graph, bakes meshes that one node uses into a world object, keeps meshes that
// several nodes share as instanced objects, streams triangles, builds treelets, tiles textures, writes tables.
// Called by bins. Parallel inside. Cost: see docs/measuring.md.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "engine/build_memory_plan.h"
#include "engine/pose_document.h"
#include "engine/position_grid.h"
#include "io/gltf_document.h"
#include "io/result.h"
#include "treelets/bvh_builder_kind.h"

namespace shoal {

struct BuildProgress {
  const char* stage = "";  ///< "reading", "decompressing", "textures", "measuring", "counting", "sorting", "building", "writing"
  double fraction = 0;     ///< of the stage
};

struct SceneBuildOptions {
  uint32_t treelet_bytes = 256u << 10;
  unsigned threads = 0;           ///< 0: all
  uint64_t max_memory_bytes = 0;  ///< of the whole process; 0: default_cap_bytes() (engine/process_memory.h)
  std::string scratch_folder;     ///< for objects that do not fit; empty: the folder of the output
  /// Gives the space of the source's binary parts back as soon as each was read for the last time. Destroys the source,
  /// also when the build fails or is stopped later on. Not for .glb.
  bool consume = false;
  PositionPrecision positions = PositionPrecision::kExact;
  BvhBuilder builder = BvhBuilder::kSah;  ///< of the objects' trees; the tree over instances is always by SAH
  PoseOptions pose;               ///< the time that skins, morph targets and nodes are posed at
  uint64_t chunk_triangles = 0;   ///< triangles built at once; 0: from the memory plan (else for tests)
  std::string variant;            ///< KHR_materials_variants, by name; empty: the materials as they are
  gltf::Limits limits;
  const std::atomic<bool>* stop = nullptr;             ///< ends the build with kStopped when it becomes true
  std::function<void(const BuildMemoryPlan&)> planned;  ///< may be empty; called once, before work starts
  std::function<void(const BuildProgress&)> progress;  ///< may be empty; called from the building thread
};

struct SceneBuildReport {
  uint64_t triangles_count = 0, instanced_triangles_count = 0, degenerate_count = 0;
  uint64_t zero_area_count = 0;  ///< of triangles_count: three corners in a line, met by rays edge on at most
  uint64_t treelets_count = 0, instances_count = 0, objects_count = 0;
  uint64_t file_bytes = 0, geometry_bytes = 0, source_read_bytes = 0;
  uint64_t chunks_count = 0;  ///< that objects which did not fit were built in
  uint64_t scratch_written_bytes = 0, scratch_read_bytes = 0;
  uint64_t consumed_bytes = 0;  ///< of the source, given back
  float position_step = 0;   ///< of the coarsest grid that positions were rounded to; 0: none was
  float position_error = 0;  ///< how far that moved a point at most, in world space
  double sah_cost = 0;
  double seconds = 0;
  std::vector<std::string> warnings;
};

/// Fails with: kInput, kUnsupported, kStorage, kMemoryCap, kStopped; nothing is left under `output` then. The same
/// source, options and cap (which sets the chunks) give the same bytes, whatever the number of threads.
Result<SceneBuildReport> build_scene(FileSystem& fs, const std::string& gltf_path, const std::string& output,
                                     const SceneBuildOptions& options);

/// What a built scene is kept under: a hash of the JSON, of sizes and modification times of the files it names, of
/// treelet size, precision of positions, builder of trees, pose, variant and builder version; not of the cap, which changes the tree but never the picture.
Result<uint64_t> build_cache_key(FileSystem& fs, const std::string& gltf_path, const SceneBuildOptions& options);

}  // namespace shoal
