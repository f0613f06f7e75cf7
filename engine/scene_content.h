// What a scene is made of, as a hash: the bytes of the glTF, of the files it names and of what options name; of a .shoal
// its directory, which has the checksum of every page. Files that look as they did when they were hashed before (size and
// time of modification) are not read again. Called by engine/batch_run. Thread rule: plain function.
// Cost: reads the files once, a block at a time; then a look at each.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "io/file.h"
#include "io/result.h"

namespace shoal {

struct HashedFile {
  std::string path;
  bool missing = false;
  uint64_t bytes = 0;
  int64_t modified_ns = 0;
  uint64_t hash = 0;
};

struct SceneContent {
  std::vector<HashedFile> files;  ///< the scene, the files it names, then those of the options
  int64_t looked_ns = 0;          ///< time of day before the first of them was looked at
  uint64_t hash = 0;              ///< of what is in them, not of their names
  bool anew = false;              ///< something was read to know it
};

/// `earlier` may be null. A file that cannot be opened counts as missing: who renders the scene says so.
/// Fails with: kStorage (reading fails), kStopped.
Result<SceneContent> hash_scene(FileSystem& fs, const std::string& scene, const std::vector<std::string>& option_files,
                                const SceneContent* earlier, const std::atomic<bool>* stop);

/// Whether sizes and times are still those.
bool looks_unchanged(FileSystem& fs, const SceneContent& content);

}  // namespace shoal
