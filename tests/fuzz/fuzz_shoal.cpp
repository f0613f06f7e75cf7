// .shoal files from strangers (tests/fuzz/shoal_input.h says how inputs stand for them): container, tables and
// pages are checked as they are for users, and rays go through whatever passes: what the checks let through must be
// safe to trace.
#include <algorithm>
#include <memory>
#include <random>

#include "engine/scene.h"
#include "io/page_codec.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/shoal_input.h"
#include "tests/support/memory_file_system.h"
#include "treelets/scene_traversal.h"
#include "treelets/trace_scene.h"
#include "treelets/trace_treelet.h"

namespace shoal::fuzz {
namespace {

constexpr uint32_t kMostInstances = 4096, kRays = 32;

/// What a page may be loaded as; 64 readable bytes follow a page.
struct alignas(64) Line {
  std::byte bytes[64] = {};
};

/// Decoded pages that passed their check, as a page cache would hand them out.
struct Pages {
  std::vector<std::vector<Line>> lines;    // by page; empty: refused
  std::vector<const std::byte*> geometry;  // by treelet; null: refused
  std::span<const std::byte> of(const Scene& scene, PageId page) const {
    if (page == kNoPage || lines[page].empty()) return {};
    return {lines[page].front().bytes, scene.file->record(page).raw_bytes};
  }
};

Pages read_pages(const Scene& scene) {
  Pages pages;
  pages.lines.resize(scene.file->page_count());
  for (const PageRecord& record : scene.file->records()) {
    if (record.kind == PageKind::kTable) continue;
    std::vector<Line> page((record.raw_bytes + 127ull) / 64);
    uint64_t read_bytes = 0;
    const std::span<std::byte> bytes(page.front().bytes, record.raw_bytes);
    if (!scene.file->read_page(record.id, bytes, &read_bytes).ok() || !check_page(scene, record, bytes).ok())
      continue;
    pages.lines[record.id] = std::move(page);
  }
  for (const TreeletPages& t : scene.treelets) {
    pages.geometry.push_back(pages.of(scene, t.geometry).data());
  }
  return pages;
}

std::vector<Ray> rays_of(const Scene& scene) {
  std::mt19937 random(7);
  const Bounds3 bounds = scene.top_tree.bounds();
  std::vector<Ray> rays(kRays);
  for (uint32_t i = 0; i < kRays; ++i) {
    Ray& ray = rays[i];
    for (int axis = 0; axis < 3; ++axis) {
      const float a = static_cast<float>(random() % 1000) / 999, b = static_cast<float>(random() % 1000) / 999;
      const float size = bounds.hi[axis] - bounds.lo[axis];
      ray.origin[axis] = bounds.lo[axis] + (i % 4 < 2 ? a : a * 4 - 2) * size;
      ray.direction[axis] = i % 8 == 7 ? (axis == 0 ? 1.0f : 0.0f) : bounds.lo[axis] + b * size - ray.origin[axis];
    }
    if (ray.direction == Vec3(0)) ray.direction = Vec3(0, 0, -1);
    ray.t = kRayInfinity;
    ray.path = i | (i % 3 == 0 ? Ray::kAnyHitBit : 0);
    ray.alpha_seed = i % 5 == 0 ? Ray::kNoCoverage : static_cast<uint32_t>(random()) & ~1u;
  }
  return rays;
}

/// What shading asks of a hit.
void look_at_hit(const Scene& scene, const Pages& pages, const Ray& ray) {
  if (!ray.hit.valid() || ray.any_hit()) return;
  require(ray.hit.treelet < scene.treelets.size() && ray.hit.instance < scene.top_tree.instance_count());
  const TreeletPages& treelet = scene.treelets[ray.hit.treelet];
  const TreeletTriangle triangle = find_triangle(pages.of(scene, treelet.geometry), ray.hit.slot);
  require(triangle.ordinal < treelet.triangle_count);
  (void)intersect_known(ray, scene.top_tree.instance(ray.hit.instance), triangle);
  const std::span<const std::byte> attributes = pages.of(scene, treelet.attributes);
  if (attributes.empty()) {
    require(triangle.material == kNoIndex || triangle.material < scene.materials.size());
    return;
  }
  require(find_attributes(attributes, triangle.ordinal).material < scene.materials.size());
}

/// Treelet by treelet, as where pages come and go.
void trace_by_treelets(const Scene& scene, const Pages& pages) {
  for (Ray ray : rays_of(scene)) {
    TraceCounters counters;
    for (;;) {
      const uint32_t index = scene.top_tree.next(ray, counters.node_tests_count);
      if (index == kNoIndex) break;
      const TreeletEntry& entry = scene.top_tree.entry(index);
      if (pages.geometry[entry.treelet] == nullptr) break;
      trace_treelet(pages.of(scene, scene.treelets[entry.treelet].geometry), entry,
                    scene.top_tree.instance(ray.instance), ray, counters);
      if (ray.any_hit() && ray.hit.valid()) break;
    }
    look_at_hit(scene, pages, ray);
  }
}

class Stream final : public RayStream {
 public:
  Stream(const Scene& scene, const Pages& pages) : scene_(scene), pages_(pages), rays_(rays_of(scene)) {}
  Ray* next() override { return taken_ < rays_.size() ? &rays_[taken_++] : nullptr; }
  void done(Ray& ray, const RayWork&) override {
    look_at_hit(scene_, pages_, ray);
    ++done_count_;
  }
  const std::byte* bring(TreeletId) override { return nullptr; }
  bool all_done() const { return done_count_ == rays_.size(); }

 private:
  const Scene& scene_;
  const Pages& pages_;
  std::vector<Ray> rays_;
  size_t taken_ = 0, done_count_ = 0;
};

/// From start to end, as where every page stays: by one of the ways that there are.
void trace_in_memory(const Scene& scene, const Pages& pages, uint64_t way) {
  const TopTree& tree = scene.top_tree;
  const PageTable table = pages.geometry.data();
  constexpr auto kTest = TriangleTest::kWatertight;
  Stream stream(scene, pages);
  TraceCounters counters;
  switch (way % 5) {
    case 0: SceneTracer(tree, table, RayGrouping::kSingle).trace(stream, counters); break;
    case 1: SceneTracer(tree, table, RayGrouping::kPackets).trace(stream, counters); break;
    case 2: make_packet_traversal(tree, table, kTest, kLeastPacketRays)->trace(stream, counters); break;
    case 3: make_reordering_traversal(tree, table, kTest, kLeastPacketRays)->trace(stream, counters); break;
    default: make_stream_traversal(tree, table, kTest)->trace(stream, counters);
  }
  require(stream.all_done());
}

}  // namespace
}  // namespace shoal::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  shoal::MemoryFileSystem fs;
  fs.put("input.shoal", shoal::fuzz::shoal_file_of(shoal::fuzz::bytes_of(data, size)));
  const auto scene = shoal::open_scene(fs, "input.shoal", shoal::ReadMode::kBuffered, {});
  if (!scene.ok()) {
    using enum shoal::ErrorCode;
    shoal::fuzz::require(scene.error().code == kInput || scene.error().code == kCorrupt);
    return 0;
  }
  if (scene.value().top_tree.instance_count() > shoal::fuzz::kMostInstances) return 0;
  const shoal::fuzz::Pages pages = shoal::fuzz::read_pages(scene.value());
  (void)shoal::verify_scene(scene.value()).ok();
  shoal::fuzz::trace_by_treelets(scene.value(), pages);
  // Chosen by the input, so that an input is always traced in the same way.
  shoal::fuzz::trace_in_memory(scene.value(), pages, shoal::hash_bytes(std::as_bytes(std::span(data, size))));
  return 0;
}
