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
  std::vector<Texture> textures;
  std::vector<Emitter> emitters;
  std::vector<PunctualLight> lights;
  std::vector<CameraRecord> cameras;
  std::string build_record;  ///< JSON

  uint64_t resident_bytes() const;
};

/// Fails with: kInput (missing, not a .shoal), kCorrupt (file, place, expected, found).
Result<Scene> open_scene(FileSystem& fs, const std::string& path, ReadMode mode, TraversalOptions traversal);

/// The check that the page cache runs on every decoded page (treelet, attribute and texture pages).
Status check_page(const PageRecord& record, std::span<const std::byte> bytes);

}  // namespace shoal
