// Scenes of any size, written as one .gltf and its .bin parts, streamed: memory does not grow with the triangles
// asked for. The same options give the same bytes on every machine (integer hashes, + - * / and sqrt only). Called
// by `shoal generate`, tests and bench. Parallel inside (oneTBB).
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "io/file.h"

namespace shoal {

struct GenerateOptions {
  /// terrain   a lit cave of unique triangles: ground, walls, ceiling, rocks, stalagmites
  /// instances a forest of instanced trees, bushes and rocks; needs --environment constant:...
  /// tile      deformed copies of a glTF side by side, no triangle shared
  /// demo      the scene of the README's picture
  std::string kind;
  uint64_t triangles = 0;  ///< about how many; 0: the kind's default
  std::string out_dir;     ///< made when missing
  std::string source;      ///< tile: the glTF to copy
  uint64_t seed = 1;
};

struct GenerateProgress {
  const char* stage = "";
  double fraction = 0;  ///< of the whole
};
/// May be empty; called from the calling thread.
using GenerateProgressCallback = std::function<void(const GenerateProgress&)>;

struct GenerateReport {
  std::string gltf_path;                   ///< <out_dir>/<kind>.gltf
  uint64_t triangles_count = 0;            ///< stored
  uint64_t instanced_triangles_count = 0;  ///< as seen: a mesh counts once for each node that shows it
  uint64_t instances_count = 0;            ///< nodes with meshes
  uint64_t file_bytes = 0;                 ///< .gltf, parts and textures
};

/// Fails with: kUsage (unknown kind, counts out of range, missing or needless source), kInput (source), kStorage.
Result<GenerateReport> generate_scene(FileSystem& fs, const GenerateOptions& options,
                                      const GenerateProgressCallback& progress = {});

inline constexpr uint64_t kMinGenerateTriangles = 1000;
inline constexpr uint64_t kMaxGenerateTriangles = 4'000'000'000;  ///< primitive ids are 32 bits

}  // namespace shoal
