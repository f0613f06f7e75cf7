#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <type_traits>

#include "engine/check_tables.h"
#include "engine/process_memory.h"
#include "engine/scene.h"

namespace shoal {

namespace {

constexpr uint64_t kMaxTextBytes = 64u << 20;

template <class T>
Result<std::vector<T>> read_rows(const PageFile& file, TableId table, const char* name) {
  static_assert(std::is_trivially_copyable_v<T>);
  SHOAL_ASSIGN_OR_RETURN(const uint64_t bytes, file.table_bytes(table, memory_limit_bytes() / 4));
  if (bytes % sizeof(T) != 0) {
    return Error{ErrorCode::kCorrupt, fmt::format("{}: table of {}: expected rows of {} bytes, found {} bytes",
                                                  file.path(), name, sizeof(T), bytes)};
  }
  if (bytes / sizeof(T) >= kNoIndex) {
    return Error{ErrorCode::kCorrupt, fmt::format("{}: table of {}: expected at most {} rows, found {}",
                                                  file.path(), name, kNoIndex - 1, bytes / sizeof(T))};
  }
  std::vector<T> rows(bytes / sizeof(T));
  SHOAL_RETURN_IF_ERROR(file.read_table_into(table, {reinterpret_cast<std::byte*>(rows.data()), bytes}));
  return rows;
}

Result<std::string> read_text(const PageFile& file, TableId table) {
  SHOAL_ASSIGN_OR_RETURN(const uint64_t bytes, file.table_bytes(table, kMaxTextBytes));
  std::string text(bytes, '\0');
  SHOAL_RETURN_IF_ERROR(file.read_table_into(table, std::as_writable_bytes(std::span(text))));
  return text;
}

Status read_top_tree(const PageFile& file, uint32_t treelet_count, TraversalOptions traversal, Scene& scene) {
  SHOAL_ASSIGN_OR_RETURN(auto nodes, read_rows<TopNode>(file, tables::kTopNodes, "top nodes"));
  SHOAL_ASSIGN_OR_RETURN(auto entries, read_rows<TreeletEntry>(file, tables::kEntries, "treelet entries"));
  SHOAL_ASSIGN_OR_RETURN(auto instances, read_rows<Instance>(file, tables::kInstances, "instances"));
  if (Status status = TopTree::check(nodes, entries, instances, treelet_count); !status.ok()) {
    return Error{status.error().code, file.path() + ": " + status.error().message};
  }
  scene.entries_by_treelet.resize(entries.size());
  std::iota(scene.entries_by_treelet.begin(), scene.entries_by_treelet.end(), 0u);
  std::sort(scene.entries_by_treelet.begin(), scene.entries_by_treelet.end(), [&](uint32_t a, uint32_t b) {
    return entries[a].treelet != entries[b].treelet ? entries[a].treelet < entries[b].treelet : a < b;
  });
  scene.top_tree = TopTree(std::move(nodes), std::move(entries), std::move(instances), traversal);
  return {};
}

}  // namespace

Result<Scene> open_scene(FileSystem& fs, const std::string& path, ReadMode mode, TraversalOptions traversal) {
  SHOAL_ASSIGN_OR_RETURN(std::unique_ptr<PageFile> file, PageFile::open(fs, path, mode));
  return read_scene(std::move(file), traversal);
}

Result<Scene> read_scene(std::unique_ptr<PageFile> page_file, TraversalOptions traversal) {
  Scene scene;
  scene.file = std::move(page_file);
  const PageFile& file = *scene.file;
  SHOAL_ASSIGN_OR_RETURN(const auto headers, read_rows<SceneHeader>(file, tables::kSceneHeader, "scene headers"));
  if (headers.size() != 1) {
    return Error{ErrorCode::kCorrupt,
                 fmt::format("{}: table of scene headers: expected 1 row, found {}", file.path(), headers.size())};
  }
  scene.header = headers[0];
  SHOAL_RETURN_IF_ERROR(check_header(scene));
  SHOAL_ASSIGN_OR_RETURN(scene.treelets, read_rows<TreeletPages>(file, tables::kTreelets, "treelets"));
  SHOAL_ASSIGN_OR_RETURN(scene.materials, read_rows<Material>(file, tables::kMaterials, "materials"));
  SHOAL_ASSIGN_OR_RETURN(scene.material_layers,
                         read_rows<MaterialLayers>(file, tables::kMaterialLayers, "material layers"));
  SHOAL_ASSIGN_OR_RETURN(scene.texture_transforms,
                         read_rows<TextureTransform>(file, tables::kTextureTransforms, "texture transforms"));
  SHOAL_ASSIGN_OR_RETURN(scene.textures, read_rows<Texture>(file, tables::kTextures, "textures"));
  SHOAL_ASSIGN_OR_RETURN(scene.emitters, read_rows<Emitter>(file, tables::kEmitters, "emitters"));
  SHOAL_ASSIGN_OR_RETURN(scene.lights, read_rows<PunctualLight>(file, tables::kLights, "lights"));
  SHOAL_ASSIGN_OR_RETURN(scene.cameras, read_rows<CameraRecord>(file, tables::kCameras, "cameras"));
  SHOAL_ASSIGN_OR_RETURN(scene.camera_keys, read_rows<Affine3>(file, tables::kCameraKeys, "camera keys"));
  SHOAL_ASSIGN_OR_RETURN(scene.build_record, read_text(file, tables::kBuildRecord));
  SHOAL_ASSIGN_OR_RETURN(scene.names, read_text(file, tables::kNames));
  if (file.has_table(tables::kSourceFiles)) {
    SHOAL_ASSIGN_OR_RETURN(scene.source_files, read_text(file, tables::kSourceFiles));
  }
  SHOAL_RETURN_IF_ERROR(read_top_tree(file, static_cast<uint32_t>(scene.treelets.size()), traversal, scene));
  SHOAL_RETURN_IF_ERROR(check_tables(scene));
  return scene;
}

uint64_t Scene::resident_bytes() const {
  const auto bytes = [](const auto& rows) { return uint64_t{rows.capacity()} * sizeof(rows[0]); };
  return top_tree.resident_bytes() + bytes(treelets) + bytes(materials) + bytes(material_layers) +
         bytes(texture_transforms) + bytes(textures) + bytes(emitters) +
         bytes(lights) + bytes(cameras) + bytes(camera_keys) + bytes(entries_by_treelet) + bytes(build_record) + bytes(names) +
         bytes(source_files) +
         file->records().size_bytes();
}

}  // namespace shoal
