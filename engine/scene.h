// An opened scene: the page file and its resident tables, checked. Shared, immutable, any number of threads.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "engine/scene_tables.h"
#include "io/page_file.h"
#include "io/result.h"
#include "treelets/top_tree.h"

namespace shoal {

struct Scene {
  std::unique_ptr<PageFile> file;
  SceneHeader header;
  TopTree top_tree;
  std::vector<TreeletPages> treelets;
  std::vector<Material> materials;
  std::vector<MaterialLayers> material_layers;
  std::vector<TextureTransform> texture_transforms;
  std::vector<Texture> textures;
  std::vector<Emitter> emitters;
  std::vector<PunctualLight> lights;
  std::vector<CameraRecord> cameras;
  std::vector<Affine3> camera_keys;
  std::vector<uint32_t> entries_by_treelet;  ///< indices of top_tree.entries(), in order of their treelet
  std::string build_record;                  ///< JSON
  std::string names;                         ///< JSON: {"materials": [...], "cameras": [...], "lights": [...]}
  std::string source_files;                  ///< engine/source_files.h; may be empty

  uint64_t resident_bytes() const;
};

/// Fails with: kInput (missing, not a .shoal), kCorrupt (file, place, expected, found).
Result<Scene> open_scene(FileSystem& fs, const std::string& path, ReadMode mode, TraversalOptions traversal);
/// The tables of an opened file. Fails with: kCorrupt.
Result<Scene> read_scene(std::unique_ptr<PageFile> file, TraversalOptions traversal);

/// The check that the page cache runs on every decoded page (treelet, attribute and texture pages): the page is
/// well formed and fits the scene's tables (triangle counts, materials, the roots that the top tree enters), so
/// that its readers need check nothing. `[&scene](auto& r, auto b) { return check_page(scene, r, b); }` is a
/// PageCheck. Fails with: kCorrupt.
Status check_page(const Scene& scene, const PageRecord& record, std::span<const std::byte> bytes);

/// Reads the whole file: every checksum, the padding, and check_page on every page. Fails with: kCorrupt, kStorage.
Status verify_scene(const Scene& scene);

}  // namespace shoal
