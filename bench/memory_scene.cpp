#include "bench/memory_scene.h"

#include <bit>
#include <cstring>

#include "io/aligned_buffer.h"
#include "treelets/treelet_view.h"

namespace shoal::bench {
namespace {

constexpr uint64_t kPageAlignBytes = 64;      // a cache line: where nodes of a page lie does not depend on the page
constexpr uint64_t kReadableBehindBytes = 64;  // as trace_treelet() requires

uint64_t room_of(const PageRecord& record) {
  return align_up(record.raw_bytes + kReadableBehindBytes, kPageAlignBytes);
}

void take_coverage_out(std::span<std::byte> page) {
  const TreeletView view(page);
  if (view.header->coverage_offset == 0) return;
  uint32_t* records = const_cast<uint32_t*>(view.coverage_of());  // in `page`, which is ours
  std::fill(records, records + view.header->triangle_count, kNoIndex);
}

/// Finds the vertex with the same bits, or appends it. Open addressing, at most half full.
class VertexTable {
 public:
  VertexTable(uint64_t expected, LargeVector<float>& vertices)
      : places_(std::bit_ceil(std::max<uint64_t>(2 * expected, 1024)), kNoIndex), vertices_(vertices) {}

  uint32_t index_of(const Vec3& p) {
    const uint64_t mask = places_.size() - 1;
    uint64_t place = hash(p) & mask;
    for (; places_[place] != kNoIndex; place = (place + 1) & mask) {
      if (std::memcmp(vertices_.data() + 3 * size_t{places_[place]}, &p, 12) == 0) return places_[place];
    }
    const auto index = static_cast<uint32_t>(vertices_.size() / 3);
    places_[place] = index;
    vertices_.insert(vertices_.end(), {p.x, p.y, p.z});
    if (2 * uint64_t{index} > places_.size()) grow();
    return index;
  }

 private:
  static uint64_t hash(const Vec3& p) {
    uint64_t h = std::bit_cast<uint32_t>(p.x) * 0x9e3779b97f4a7c15u;
    h = (h ^ std::bit_cast<uint32_t>(p.y)) * 0xc2b2ae3d27d4eb4fu;
    h = (h ^ (h >> 29) ^ std::bit_cast<uint32_t>(p.z)) * 0x165667b19e3779f9u;
    return h ^ (h >> 32);
  }

  void grow() {
    LargeVector<uint32_t>(2 * places_.size(), kNoIndex).swap(places_);
    const uint64_t mask = places_.size() - 1;
    for (uint32_t index = 0; index < vertices_.size() / 3; ++index) {
      Vec3 p;
      std::memcpy(&p, vertices_.data() + 3 * size_t{index}, 12);
      uint64_t place = hash(p) & mask;
      while (places_[place] != kNoIndex) place = (place + 1) & mask;
      places_[place] = index;
    }
  }

  LargeVector<uint32_t> places_;
  LargeVector<float>& vertices_;
};

void append_triangles(const TreeletView& view, const Instance& instance, VertexTable& vertices, WorldMesh& mesh) {
  for (uint32_t offset = 0; offset < view.header->leaves_bytes;) {
    const LeafView leaf = view.leaf(offset / 4);
    for (uint32_t triangle = 0; triangle < leaf.triangle_count; ++triangle) {
      for (uint32_t corner = 0; corner < 3; ++corner) {
        const Vec3 p = leaf.position(triangle, corner);
        mesh.indices.push_back(vertices.index_of(instance.identity != 0 ? p : instance.object_to_world.point(p)));
      }
    }
    offset += leaf.bytes();
  }
}

}  // namespace

Result<MemoryScene> load_into_memory(const std::string& path) {
  MemoryScene memory;
  SHOAL_ASSIGN_OR_RETURN(memory.scene, open_scene(posix_file_system(), path, ReadMode::kBuffered, {}));
  const Scene& scene = memory.scene;
  uint64_t arena_bytes = 0;
  for (const TreeletPages& pages : scene.treelets) arena_bytes += room_of(scene.file->record(pages.geometry));
  memory.arena = map_huge_memory(arena_bytes);
  std::byte* next = memory.arena.get();
  for (const TreeletPages& pages : scene.treelets) {
    const PageRecord& record = scene.file->record(pages.geometry);
    const std::span<std::byte> bytes(next, record.raw_bytes);
    uint64_t read_bytes = 0;
    SHOAL_RETURN_IF_ERROR(scene.file->read_page(record.id, bytes, &read_bytes));
    SHOAL_RETURN_IF_ERROR(check_page(scene, record, bytes));
    take_coverage_out(bytes);
    memory.pages.emplace_back(bytes);
    memory.geometry_bytes += bytes.size();
    next += room_of(record);
  }
  return memory;
}

std::vector<TreeletId> treelets_below(const TopTree& tree, uint32_t node) {
  std::vector<TreeletId> found;
  std::vector<uint32_t> open{node};
  while (!open.empty()) {
    const TopNode& top = tree.nodes()[open.back()];
    open.pop_back();
    for (int slot = 0; slot < 8; ++slot) {
      if (top.kind[slot] == ChildKind::kNode) open.push_back(top.child[slot]);
      if (top.kind[slot] == ChildKind::kEntry) found.push_back(tree.entry(top.child[slot]).treelet);
    }
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

uint32_t WorldMesh::instance_of(uint64_t triangle) const {
  const auto after = std::upper_bound(instances.begin(), instances.end(), triangle,
                                      [](uint64_t t, const InstanceStart& i) { return t < i.first_triangle; });
  return (after - 1)->instance;
}

Result<WorldMesh> take_mesh(const MemoryScene& memory) {
  const uint64_t triangles = memory.scene.header.instanced_triangles_count;
  if (triangles >= kNoIndex / 3) {
    return Error{ErrorCode::kUsage, memory.scene.file->path() + ": more triangles than one Embree mesh is given here"};
  }
  WorldMesh mesh;
  mesh.indices.reserve(3 * triangles);
  mesh.vertices.reserve(2 * triangles);  // of a large closed mesh 1.5 floats a triangle
  VertexTable vertices(triangles / 2, mesh.vertices);
  const TopTree& tree = memory.top_tree();
  for (uint32_t index = 0; index < tree.instance_count(); ++index) {
    const Instance& instance = tree.instance(index);
    mesh.instances.push_back({mesh.triangle_count(), index});
    for (const TreeletId id : treelets_below(tree, instance.root_node)) {
      append_triangles(TreeletView(memory.pages[id]), instance, vertices, mesh);
    }
  }
  mesh.vertices.push_back(0);
  return mesh;
}

}  // namespace shoal::bench
