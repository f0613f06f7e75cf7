// The scenes under a folder: .gltf, .glb and .shoal files in any folder below it, but for hidden ones. Called by
// engine/batch_plan. Thread rule: plain function. Cost: reads every folder once.
#pragma once

#include <string>
#include <vector>

#include "io/result.h"

namespace shoal {

struct SceneSearch {
  std::string folder;
  std::vector<std::string> include;  ///< patterns (engine/glob.h); empty: every scene
  std::vector<std::string> exclude;  ///< what they match is left out, a folder with all below it
  std::string skipped_folder;        ///< not looked into: where the pictures go
};

struct FoundScene {
  std::string path;     ///< from the folder, with / between names
  bool chosen = false;  ///< by the patterns
};

struct FoundScenes {
  std::vector<FoundScene> scenes;       ///< in the order of their bytes
  std::vector<std::string> unreadable;  ///< folders: one sentence each
};

/// Each folder is read once, whatever symbolic links there are: real folders first, then those that only a link leads to.
/// A folder that cannot be read is noted. Fails with: kInput (`folder` itself cannot be read), kUsage (patterns).
Result<FoundScenes> find_scenes(const SceneSearch& search);

bool is_shoal_path(const std::string& path);

}  // namespace shoal
