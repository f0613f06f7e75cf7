// A soup of triangles through the whole build (in memory, in chunks, or under the least memory that works), opened, and
// made ready to be traced every way and rendered in every order. Header only.
#pragma once

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "engine/render.h"
#include "tests/engine/built_scene.h"
#include "tests/numerics/every_kernel.h"
#include "tests/support/sample_soups.h"

namespace shoal::testing {

/// scene.gltf of `fs`, 32-bit floats without indices: primitive ids are the order.
inline void save_soup(MemoryFileSystem& fs, const TriangleSoup& soup) {
  WrittenScene scene;
  const uint32_t positions = scene.add_floats(3, soup.positions);
  scene.add_node({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", positions}}}})}});
  scene.save(fs);
}

/// Why a triangle is left out, by its definition (docs/numerics.md): a corner that is not finite or beyond 2^125, or two
/// corners that are equal.
inline bool is_left_out(const float* p) {
  for (int i = 0; i < 9; ++i) {
    if (!(std::abs(p[i]) <= 0x1p125f)) return true;
  }
  const auto same = [p](int a, int b) { return p[a] == p[b] && p[a + 1] == p[b + 1] && p[a + 2] == p[b + 2]; };
  return same(0, 3) || same(3, 6) || same(6, 0);
}

/// Those that are not left out; of triangles that are the same only the first, which is the one to be hit.
inline std::vector<TestTriangle> triangles_to_hit(const TriangleSoup& soup) {
  std::vector<TestTriangle> all;
  std::map<std::array<float, 9>, uint32_t> seen;
  for (size_t i = 0; i < soup.size(); ++i) {
    const float* p = &soup.positions[9 * i];
    if (is_left_out(p)) continue;
    std::array<float, 9> key;
    std::copy_n(p, 9, key.begin());
    if (!seen.emplace(key, 0).second) continue;
    all.push_back({{{p[0], p[1], p[2]}, {p[3], p[4], p[5]}, {p[6], p[7], p[8]}}, static_cast<uint32_t>(i)});
  }
  return all;
}

inline TestScene scene_to_trace(const BuiltScene& built, std::vector<TestTriangle> triangles) {
  TestScene scene;
  const TopTree& tree = built.scene.top_tree;
  scene.nodes.assign(tree.nodes().begin(), tree.nodes().end());
  scene.entries.assign(tree.entries().begin(), tree.entries().end());
  scene.instances.assign(tree.instances().begin(), tree.instances().end());
  for (const TreeletPages& pages : built.scene.treelets) {
    std::vector<std::byte> bytes(built.scene.file->record(pages.geometry).raw_bytes);
    uint64_t read_bytes = 0;
    EXPECT_TRUE(built.scene.file->read_page(pages.geometry, bytes, &read_bytes).ok());
    scene.pages.emplace_back(bytes);
  }
  scene.objects.push_back(std::move(triangles));
  return scene;
}

/// The build under the least memory that works.
inline SceneBuildOptions least_memory(MemoryFileSystem& fs) {
  SceneBuildOptions options;
  options.threads = 1;
  options.max_memory_bytes = 1 << 20;
  const std::string message = build_error(fs, ErrorCode::kMemoryCap, options);
  options.max_memory_bytes = std::stoull(message.substr(message.find("needs ") + 6)) << 20;
  return options;
}

/// Rays at these triangles from all about, along axes, at corners, in their planes and from their corners, as far as each
/// triangle is large.
inline std::vector<Ray> rays_at(const std::vector<TestTriangle>& triangles, size_t count, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(0, 1);
  std::vector<Ray> rays;
  while (rays.size() < count) {
    const TestTriangle& t = triangles[random() % triangles.size()];
    const float b1 = uniform(random), b2 = (1 - b1) * uniform(random);
    Vec3 target = t.p[0] * (1 - b1 - b2) + t.p[1] * b1 + t.p[2] * b2;
    const Vec3 extent = bounds_of(t).extent();
    const float size = std::max(extent.x, std::max(extent.y, extent.z)) * std::exp2(8 * uniform(random) - 2);
    Vec3 origin = target + random_vector(random) * size, direction = target - origin;
    switch (rays.size() % 6) {
      case 1: {
        const int axis = static_cast<int>(random() % 3);
        direction = Vec3(0), direction[axis] = random() % 2 == 0 ? 1.0f : -1.0f;
        origin = target;
        origin[axis] -= direction[axis] * size;
        break;
      }
      case 2:
        direction = t.p[random() % 3] - origin;
        break;
      case 3:
        origin = t.p[0] + (t.p[1] - t.p[0]) * 3.0f, direction = t.p[2] - origin;
        break;
      case 4:
        origin = t.p[0], direction = random_vector(random);
        break;
      default:
        break;
    }
    const auto usable = [](const Vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); };
    if (!usable(origin) || !usable(direction) || direction == Vec3(0)) continue;
    rays.push_back(make_ray(origin, direction, kRayInfinity, rays.size() % 5 == 4));
  }
  return rays;
}

}  // namespace shoal::testing
