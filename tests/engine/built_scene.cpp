#include "tests/engine/built_scene.h"

#include <algorithm>
#include <stdexcept>

namespace shoal::testing {

namespace {

std::vector<std::byte> read_page(const Scene& scene, PageId page) {
  std::vector<std::byte> bytes(scene.file->record(page).raw_bytes);
  uint64_t read_bytes = 0;
  const Status status = scene.file->read_page(page, bytes, &read_bytes);
  if (!status.ok()) throw std::runtime_error(status.error().message);
  return bytes;
}

/// The object's nodes as the builder returned them: they lie together, its root first.
BuiltObject object_of(const Scene& scene, uint32_t root) {
  BuiltObject object;
  const auto nodes = scene.top_tree.nodes();
  for (uint32_t i = root; i < nodes.size() && (i == root || nodes[i].parent != kNoIndex); ++i) {
    TopNode node = nodes[i];
    if (node.parent != kNoIndex) node.parent -= root << 3;
    for (int slot = 0; slot < 8; ++slot) {
      if (node.kind[slot] == ChildKind::kNode) node.child[slot] -= root;
    }
    object.nodes.push_back(node);
  }
  uint32_t first = kNoIndex, end = 0;
  for (const TopNode& node : object.nodes) {
    for (int slot = 0; slot < 8; ++slot) {
      if (node.kind[slot] != ChildKind::kEntry) continue;
      first = std::min(first, node.child[slot]), end = std::max(end, node.child[slot] + 1);
    }
  }
  for (TopNode& node : object.nodes) {
    for (int slot = 0; slot < 8; ++slot) node.child[slot] -= node.kind[slot] == ChildKind::kEntry ? first : 0;
  }
  const auto entries = scene.top_tree.entries();
  object.entries.assign(entries.begin() + first, entries.begin() + end);
  return object;
}

std::vector<ReadTriangle> read_triangles(const Scene& scene, uint32_t root,
                                         const std::vector<StoredTreelet>& treelets) {
  std::vector<ReadTriangle> triangles;
  read_object(object_of(scene, root), treelets, [&](const ReadTriangle& t) { triangles.push_back(t); });
  std::sort(triangles.begin(), triangles.end(),
            [](const ReadTriangle& a, const ReadTriangle& b) { return a.primitive < b.primitive; });
  return triangles;
}

}  // namespace

Status check_all_pages(const Scene& scene) {
  for (const PageRecord& record : scene.file->records()) {
    if (record.kind == PageKind::kTable) continue;
    std::vector<std::byte> bytes(record.raw_bytes);
    uint64_t read_bytes = 0;
    SHOAL_RETURN_IF_ERROR(scene.file->read_page(record.id, bytes, &read_bytes));
    SHOAL_RETURN_IF_ERROR(check_page(scene, record, bytes));
  }
  return {};
}

BuiltScene build_and_open(FileSystem& fs, const SceneBuildOptions& options, const std::string& path,
                          const std::string& output, uint64_t read_back_limit) {
  const auto require = [](const auto& result) {
    if (result.ok()) return;
    ADD_FAILURE() << result.error().message;
    throw std::runtime_error(result.error().message);
  };
  auto report = build_scene(fs, path, output, options);
  require(report);
  auto scene = open_scene(fs, output, ReadMode::kBuffered, {});
  require(scene);
  require(scene.value().file->verify());
  require(check_all_pages(scene.value()));
  BuiltScene built{std::move(report).value(), std::move(scene).value(), {}};
  if (built.report.triangles_count > read_back_limit) return built;
  std::vector<StoredTreelet> treelets;
  for (const TreeletPages& pages : built.scene.treelets) {
    treelets.push_back({read_page(built.scene, pages.geometry), pages.attributes == kNoPage
                                                                    ? std::vector<std::byte>{}
                                                                    : read_page(built.scene, pages.attributes)});
  }
  built.objects.resize(built.report.objects_count);
  for (const Instance& instance : built.scene.top_tree.instances()) {
    auto& object = built.objects[instance.object];
    if (object.empty()) object = read_triangles(built.scene, instance.root_node, treelets);
  }
  return built;
}

std::string build_error(FileSystem& fs, ErrorCode code, const SceneBuildOptions& options) {
  auto report = build_scene(fs, "scene.gltf", "scene.shoal", options);
  if (report.ok()) {
    ADD_FAILURE() << "expected the build to fail";
    return {};
  }
  EXPECT_EQ(report.error().code, code) << report.error().message;
  return report.error().message;
}

}  // namespace shoal::testing
