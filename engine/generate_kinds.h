// What generate_scene hands to each kind of scene, and the kinds themselves (one .cpp each). Not called from
// elsewhere.
#pragma once

#include <algorithm>

#include "engine/generate.h"
#include "engine/gltf_writer.h"

namespace shoal {

struct GenerateContext {
  FileSystem& fs;
  const GenerateOptions& options;  ///< triangles filled in
  const GenerateProgressCallback& progress;

  void report_progress(const char* stage, uint64_t done, uint64_t of) const {
    if (progress) progress({stage, std::min(1.0, static_cast<double>(done) / static_cast<double>(of))});
  }
};

/// Each fills the writer's document and the counts of the report; textures add to report.file_bytes.
Status generate_terrain(const GenerateContext& context, GltfWriter& writer, GenerateReport& report);
Status generate_instances(const GenerateContext& context, GltfWriter& writer, GenerateReport& report);
Status generate_tile(const GenerateContext& context, GltfWriter& writer, GenerateReport& report);
Status generate_demo(const GenerateContext& context, GltfWriter& writer, GenerateReport& report);

}  // namespace shoal
