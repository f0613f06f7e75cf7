#include "engine/generate.h"

#include <fmt/format.h>

#include "engine/generate_kinds.h"

namespace shoal {
namespace {

struct Kind {
  const char* name;
  uint64_t default_triangles;
  Status (*generate)(const GenerateContext&, GltfWriter&, GenerateReport&);
};

constexpr Kind kKinds[] = {
    {"terrain", 10'000'000, generate_terrain},
    {"instances", 10'000'000, generate_instances},
    {"tile", 10'000'000, generate_tile},
    {"demo", 8'000'000, generate_demo},
};

Result<const Kind*> find_kind(const GenerateOptions& options) {
  for (const Kind& kind : kKinds) {
    if (options.kind == kind.name) return &kind;
  }
  return Error{ErrorCode::kUsage,
               fmt::format("generate: expected terrain, instances, tile or demo, found \"{}\"", options.kind)};
}

Status check_options(const GenerateOptions& options) {
  if (options.out_dir.empty()) return Error{ErrorCode::kUsage, "generate: an output folder is needed"};
  if (options.triangles < kMinGenerateTriangles || options.triangles > kMaxGenerateTriangles) {
    return Error{ErrorCode::kUsage, fmt::format("generate: expected {} to {} triangles, found {}",
                                                kMinGenerateTriangles, kMaxGenerateTriangles, options.triangles)};
  }
  const bool tile = options.kind == "tile";
  if (tile && options.source.empty()) return Error{ErrorCode::kUsage, "generate tile: a glTF to copy is needed"};
  if (!tile && !options.source.empty()) {
    return Error{ErrorCode::kUsage, fmt::format("generate {}: takes no glTF to copy", options.kind)};
  }
  return {};
}

}  // namespace

Result<GenerateReport> generate_scene(FileSystem& fs, const GenerateOptions& options,
                                      const GenerateProgressCallback& progress) {
  SHOAL_ASSIGN_OR_RETURN(const Kind* kind, find_kind(options));
  GenerateOptions filled = options;
  if (filled.triangles == 0) filled.triangles = kind->default_triangles;
  SHOAL_RETURN_IF_ERROR(check_options(filled));
  SHOAL_RETURN_IF_ERROR(fs.create_folder(filled.out_dir));
  SHOAL_ASSIGN_OR_RETURN(const std::unique_ptr<GltfWriter> writer,
                         GltfWriter::create(fs, filled.out_dir, filled.kind));
  GenerateReport report;
  SHOAL_RETURN_IF_ERROR(kind->generate({fs, filled, progress}, *writer, report));
  SHOAL_ASSIGN_OR_RETURN(const uint64_t scene_bytes, writer->finish());
  report.file_bytes += scene_bytes;
  report.gltf_path = writer->gltf_path();
  return report;
}

}  // namespace shoal
