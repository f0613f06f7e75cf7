// Gives the space of a source's binary parts back while a scene is built from them (--consume): each part once the last
// primitive that reads it was read for the last time. The source is destroyed: its parts keep their size and read as
// zero. The .gltf and its images stay. Called by engine/build_scene. One thread.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "engine/plan_objects.h"

namespace shoal {

class SourceConsumer {
 public:
  /// Plans what goes when. Parts outside the scene's folder, behind a link, with a second
  /// name, or that are images or
  /// the output stay, with a warning. Fails with: kUsage (a .glb, whose parts lie in the file itself).
  static Result<SourceConsumer> plan(FileSystem& fs, const gltf::Document& document, const GeometryPlan& geometry,
                                     const std::string& output, std::vector<std::string>& warnings);
  /// The primitive was read for the last time. Fails with: kStorage.
  Status source_done(const PrimitiveSource& source);
  uint64_t released_bytes() const { return released_bytes_; }

 private:
  FileSystem* fs_ = nullptr;
  struct Part {
    std::string path;
    uint64_t bytes = 0;
  };
  std::map<std::pair<uint32_t, uint32_t>, std::vector<Part>> parts_of_;  // by mesh and primitive, the last user
  uint64_t released_bytes_ = 0;
};

}  // namespace shoal
