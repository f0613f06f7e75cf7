// A scene that fits in memory: the top tree and every geometry page of a .shoal in one arena on large pages, each at
// a multiple of 64 bytes with 64 readable bytes behind it. And its triangles as an indexed mesh in world space, for
// programs that bring their own tree. Made once by bench/against_embree; immutable, any number of threads.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "bench/large_vector.h"
#include "engine/scene.h"

namespace shoal::bench {

struct MemoryScene {
  Scene scene;
  HugeMemory arena;
  std::vector<std::span<const std::byte>> pages;  ///< geometry, by treelet
  uint64_t geometry_bytes = 0;

  const TopTree& top_tree() const { return scene.top_tree; }
};

/// Coverage is taken out: every triangle is opaque, as it is for programs that know no alpha.
/// Fails with: kInput, kCorrupt, kStorage.
Result<MemoryScene> load_into_memory(const std::string& path);

/// Treelets below `node`, each once, ascending.
std::vector<TreeletId> treelets_below(const TopTree& tree, uint32_t node);

/// Vertices with the same bits are stored once.
struct WorldMesh {
  struct InstanceStart {
    uint64_t first_triangle;
    uint32_t instance;
  };
  LargeVector<float> vertices;  ///< one float more at the end: 16 bytes may be read at each vertex
  LargeVector<uint32_t> indices;
  std::vector<InstanceStart> instances;  ///< ascending

  uint64_t triangle_count() const { return indices.size() / 3; }
  uint64_t vertex_count() const { return vertices.size() / 3; }
  uint64_t bytes() const { return 4 * (vertices.size() + indices.size()); }
  Vec3 position(uint64_t triangle, uint32_t corner) const {
    const float* p = vertices.data() + 3 * size_t{indices[3 * triangle + corner]};
    return {p[0], p[1], p[2]};
  }
  uint32_t instance_of(uint64_t triangle) const;
};

/// Corners as the pages hold them (exact float32); those of instances moved into the world in float.
/// Fails with: kUsage (more vertices or triangles than 32 bits count).
Result<WorldMesh> take_mesh(const MemoryScene& scene);

}  // namespace shoal::bench
