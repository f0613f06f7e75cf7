#include "bench/given_scene.h"

#include <fmt/format.h>
#include <unistd.h>

#include "engine/generate.h"

namespace shoal::bench {
namespace {

Result<std::string> built(const std::string& gltf, const WorkFolder& folder, const SceneBuildOptions& options) {
  folder.make();
  const std::string output = folder / "scene.shoal";
  SHOAL_RETURN_IF_ERROR(build_scene(posix_file_system(), gltf, output, options));
  return output;
}

}  // namespace

WorkFolder::WorkFolder(const std::string& parent, const std::string& program)
    : path_(std::filesystem::path(parent) / fmt::format("shoal-{}-{}", program, ::getpid())) {}

WorkFolder::~WorkFolder() {
  std::error_code code;
  std::filesystem::remove_all(path_, code);
}

Result<std::string> scene_file(const GivenScene& scene, const WorkFolder& folder, const SceneBuildOptions& build) {
  if (scene.path.ends_with(".gltf") || scene.path.ends_with(".glb")) return built(scene.path, folder, build);
  if (!scene.path.empty()) return scene.path;
  GenerateOptions options;
  options.kind = scene.kind;
  options.triangles = scene.triangles;
  options.out_dir = folder / "source";
  SHOAL_ASSIGN_OR_RETURN(const GenerateReport generated, generate_scene(posix_file_system(), options));
  return built(generated.gltf_path, folder, build);
}

}  // namespace shoal::bench
