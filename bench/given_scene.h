// The scene that a program is asked to trace: a .shoal as it is, a glTF that is built first, or a scene that is generated.
// Called by bench/against_embree, bench/cache_traffic and bench/visibility.
#pragma once

#include <filesystem>
#include <string>

#include "engine/build_scene.h"

namespace shoal::bench {

/// For what is built on the way; made when it is needed, removed with all it holds.
class WorkFolder {
 public:
  /// `program` is part of its name.
  WorkFolder(const std::string& parent, const std::string& program);
  ~WorkFolder();
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;
  std::string operator/(const std::string& name) const { return (path_ / name).string(); }
  void make() const { std::filesystem::create_directories(path_); }

 private:
  std::filesystem::path path_;
};

struct GivenScene {
  std::string path;               ///< .shoal, .gltf or .glb; empty: it is generated
  uint64_t triangles = 1'000'000;  ///< of the generated scene
  std::string kind = "terrain";    ///< of the generated scene

  std::string name() const { return path.empty() ? kind : std::filesystem::path(path).stem().string(); }
};

/// The .shoal to trace: as it was given, or made in `folder`. Fails with: as generate_scene(), build_scene().
Result<std::string> scene_file(const GivenScene& scene, const WorkFolder& folder, const SceneBuildOptions& build = {});

}  // namespace shoal::bench
