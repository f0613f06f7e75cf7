// The files that a scene is built from: watched while it is built, remembered in the .shoal (table kSourceFiles), and
// looked at again before it is rendered. Sizes and a hash of the JSON are remembered, no clock and no absolute path:
// the same source, lying the same way from the output, gives the same bytes with the same options and cap. Called by
// engine/build_scene and bins.
// Thread rule: one thread. Cost: opens each file; a check before a render reads the JSON as well.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/file.h"
#include "io/gltf_document.h"
#include "io/result.h"

namespace shoal {

struct Scene;

struct SourceFile {
  std::string path;
  bool missing = false;
  uint64_t bytes = 0;
  int64_t modified_ns = 0;
};

/// The first is the document, then the files of its buffers and of its images, each once.
class SourceFiles {
 public:
  explicit SourceFiles(FileSystem& fs) : fs_(&fs) {}
  /// Looks at the document, before it is read. Fails with: kStorage; one that is missing is noted as such.
  Status add_document(const std::string& path) { return add(path); }
  /// Looks at the files that it names, before they are read. Fails likewise.
  Status add_parts(const gltf::Document& document);
  /// Looks again. Fails with: kInput when a file is gone, or has another size or, with `times`, another time of
  /// modification (a build that consumes its source sets it itself); kStorage.
  Status check_unchanged(bool times) const;

  const std::vector<SourceFile>& files() const { return files_; }
  uint64_t json_hash() const { return json_hash_; }
  /// The table of a .shoal at `output`.
  std::string table(const std::string& output) const;

 private:
  Status add(const std::string& path);

  FileSystem* fs_;
  std::vector<SourceFile> files_;
  uint64_t json_hash_ = 0;
};

/// Whether the source that the .shoal was built from is still what it was, as far as sizes and the JSON tell; files
/// that are no longer where they were, and a .shoal that remembers none, tell nothing. Fails with: kInput, kStorage.
Status check_source_is_unchanged(FileSystem& fs, const Scene& scene);

}  // namespace shoal
