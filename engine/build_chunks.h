// An object that does not fit in memory, built out of core: its triangles stream by twice to be measured and counted
// into a grid, the grid is split into chunks that fit, the triangles stream by once more into a scratch file sorted by
// chunk, and each chunk is read back and built while the next is read. The trees above the treelets of all chunks are
// joined under the splits, so that the top tree is that of an object built at once.
// Called by engine/build_scene. Parallel inside. The result depends on the source, the options and the chunk size only.
// Cost: three passes over the source's positions, one over its attributes, two over the scratch file; see
// docs/decisions/0011-building-out-of-core.md.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "engine/build_memory_plan.h"
#include "engine/chunk_records.h"
#include "engine/emitters.h"
#include "treelets/build_object.h"

namespace shoal {

/// What an object is built with, whether it fits or not.
struct ObjectBuildInput {
  FileSystem& fs;
  std::string path;            ///< of the glTF, for messages
  std::string scratch_folder;
  const std::atomic<bool>* stop;
  BuildOptions treelets;
  PositionPrecision positions;
  const BuildMemoryPlan& memory;
  const CoverageSource& coverage;
  const std::vector<Material>& materials;
  TreeletSink& sink;
  /// `stage` as in BuildProgress, and how many more triangles it is done with.
  std::function<void(const char* stage, uint64_t triangles)> progress;
  /// All of a primitive was read for the last time.
  std::function<Status(const PrimitiveSource&)> source_done;
};

struct ObjectBuildOutput {
  BuiltObject object;
  std::vector<Emitter> emitters;  ///< object space, in order of primitive
  uint64_t degenerate_count = 0;  ///< left out while reading; object.degenerate_count counts others
  uint64_t zero_area_count = 0;   ///< stored
  uint64_t chunks_count = 0;      ///< 0: it was built at once
  PositionGrid grid;              ///< that its positions were rounded to
  uint64_t scratch_written_bytes = 0, scratch_read_bytes = 0;
};

/// Builds an object of `triangles` in memory. Fails with: kInput, kStorage, kStopped.
Result<ObjectBuildOutput> build_at_once(ObjectSource& source, uint64_t triangles, const ObjectBuildInput& input);

/// Builds it in chunks. Fails with: kInput (also when the source changes under way), kStorage, kStopped.
Result<ObjectBuildOutput> build_in_chunks(ObjectSource& source, uint64_t triangles, const MaterialLookup& materials,
                                          const ObjectBuildInput& input);

}  // namespace shoal
