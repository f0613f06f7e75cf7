// Geometry that breaks careless builders, through the whole build in memory and out of core: counted, bounded, and traced
// every way against every triangle of the source; and rendered in every order to one picture.
#include <gtest/gtest.h>

#include <functional>

#include "tests/numerics/built_soup.h"

namespace shoal::testing {
namespace {

struct Case {
  std::string name;
  TriangleSoup soup;
  size_t hits_at_least;  ///< of 300 rays
};

constexpr float kUlp = 0x1p-23f;

Vec3 in_cube(Numbers& numbers) { return {numbers.uniform(-1, 1), numbers.uniform(-1, 1), numbers.uniform(-1, 1)}; }

/// Sound triangles with all that is not sound among them.
TriangleSoup degenerate_mixture() {
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinite = std::numeric_limits<float>::infinity();
  TriangleSoup soup = random_soup(3000, 0.1f);
  for (size_t i = 0; i < soup.size(); ++i) {
    float* p = &soup.positions[9 * i];
    switch (i % 12) {
      case 1: std::copy_n(p, 3, p + 3 * (1 + i % 2)); break;                    // two corners alike
      case 3: std::copy_n(p, 3, p + 3), std::copy_n(p, 3, p + 6); break;        // all three
      case 4: for (int c = 0; c < 3; ++c) p[6 + c] = 0.5f * (p[c] + p[3 + c]); break;  // in a line, nearly
      case 5: p[0] = 0.25f, p[1] = p[2] = 0.5f, p[3] = 0.5f, p[4] = p[5] = 0.5f, p[6] = 0.75f, p[7] = p[8] = 0.5f; break;
      case 6: p[i % 9] = nan; break;
      case 7: p[i % 9] = i % 2 == 0 ? infinite : -infinite; break;
      case 8: p[i % 9] = 1e38f; break;                                          // beyond what is stored
      case 9: std::copy_n(p - 9, 9, p); break;                                  // as the one before
      case 10: std::copy_n(&soup.positions[0], 9, p); break;                    // as the first of all
      default: break;
    }
  }
  return soup;
}

/// The same box about the same centre.
TriangleSoup one_box(size_t count) {
  TriangleSoup soup;
  Numbers numbers(4);
  for (size_t i = 0; i < count; ++i) {
    Vec3 a(-1), b(1), c = in_cube(numbers);
    const int axis = static_cast<int>(i % 3);
    if (i % 2 == 1) std::swap(a[axis], b[axis]);
    add_triangle(soup, a, b, c);
  }
  return soup;
}

/// Boxes of all sizes about one centre.
TriangleSoup one_centroid(size_t count) {
  TriangleSoup soup;
  Numbers numbers(5);
  for (size_t i = 0; i < count; ++i) {
    const Vec3 a = in_cube(numbers) * std::ldexp(1.0f, -static_cast<int>(numbers.below(12)));
    const Vec3 inside = in_cube(numbers) * glm::abs(a);
    add_triangle(soup, a, -a, inside);
  }
  return soup;
}

/// All corners on the eight points of a cube whose edge is one unit in the last place.
TriangleSoup in_one_ulp(size_t count) {
  TriangleSoup soup;
  Numbers numbers(6);
  const auto corner = [](uint32_t bits) {
    return Vec3(1) + kUlp * Vec3(static_cast<float>(bits & 1), static_cast<float>(bits >> 1 & 1),
                                 static_cast<float>(bits >> 2 & 1));
  };
  while (soup.size() < count) {
    const uint32_t a = numbers.below(8), b = numbers.below(8), c = numbers.below(8);
    if (a != b && b != c && c != a) add_triangle(soup, corner(a), corner(b), corner(c));
  }
  return soup;
}

/// Sizes and places from 1e-30 to 1e30.
TriangleSoup of_all_sizes(size_t count) {
  TriangleSoup soup;
  Numbers numbers(7);
  for (size_t i = 0; i < count; ++i) {
    const float size = std::pow(10.0f, static_cast<float>(static_cast<int>(i % 61) - 30));
    const Vec3 at = in_cube(numbers) * (i % 2 == 0 ? size : 1e30f);
    add_triangle(soup, at + in_cube(numbers) * size, at + in_cube(numbers) * size, at + in_cube(numbers) * size);
  }
  return soup;
}

/// Each half as large as the one before and beside it, so that splits peel one after the other off.
TriangleSoup nested_octaves(size_t octaves, size_t of_each) {
  TriangleSoup soup;
  for (size_t k = 0; k < octaves; ++k) {
    const float size = std::ldexp(1.0f, 120 - static_cast<int>(k));
    for (size_t i = 0; i < of_each; ++i) {
      const float step = 1 + static_cast<float>(i) / static_cast<float>(4 * of_each);
      add_triangle(soup, {size * step, 0, 0}, {size * step, size, 0.1f * size}, {size * step, 0.2f * size, size});
    }
  }
  return soup;
}

std::vector<Case> cases() {
  return {{"degenerate", degenerate_mixture(), 120},       {"one box", one_box(5000), 120},
          {"one centroid", one_centroid(5000), 120},       {"in one ulp", in_one_ulp(5000), 50},
          {"of all sizes", of_all_sizes(3000), 60},        {"nested octaves", nested_octaves(240, 16), 100}};
}

size_t left_out(const TriangleSoup& soup) {
  size_t count = 0;
  for (size_t i = 0; i < soup.size(); ++i) count += is_left_out(&soup.positions[9 * i]);
  return count;
}

size_t without_area(const TriangleSoup& soup) {
  size_t count = 0;
  for (size_t i = 0; i < soup.size(); ++i) {
    const float* p = &soup.positions[9 * i];
    if (is_left_out(p)) continue;
    using Exact = glm::vec<3, long double>;
    const Exact a(p[0], p[1], p[2]), b(p[3], p[4], p[5]), c(p[6], p[7], p[8]);
    count += glm::cross(b - a, c - a) == Exact(0);
  }
  return count;
}

/// Traces the scene every way and expects what testing every triangle gives. Returns how many rays hit.
size_t compare_with_every_triangle(const BuiltScene& built, const std::vector<TestTriangle>& triangles,
                                   const std::vector<Ray>& rays) {
  const TestScene scene = scene_to_trace(built, triangles);
  const std::vector<Ray> found = trace_every_way(scene, rays);
  size_t hits = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    Ray expected = rays[i];
    brute_force(scene, expected);
    const bool same = expected.hit.valid() == found[i].hit.valid() &&
                      (rays[i].any_hit() || !expected.hit.valid() ||
                       (expected.t == found[i].t && expected.hit.primitive == found[i].hit.primitive));
    EXPECT_TRUE(same) << "ray " << i << ": " << expected.hit.primitive << " at " << expected.t << ", found "
                      << found[i].hit.primitive << " at " << found[i].t;
    if (!same) return hits;
    hits += expected.hit.valid();
  }
  return hits;
}

/// Queued, depth-first, sorted and hybrid give one picture of finite numbers.
void expect_one_picture(FileSystem& fs, const Scene& scene) {
  PictureOptions picture;
  picture.width = 12, picture.height = 10, picture.samples = 2;
  picture.shading.bounces = 4;
  picture.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(1), {}};
  std::vector<float> first;
  for (const Order order : {Order::kDepthFirst, Order::kQueued, Order::kSorted, Order::kHybrid}) {
    ExecutionOptions execution;
    execution.order = order, execution.threads = 2, execution.rays_in_flight = 1024;
    const auto result = render(fs, scene, picture, execution);
    ASSERT_TRUE(result.ok()) << result.error().message;
    for (const float value : result.value().rgba) ASSERT_TRUE(std::isfinite(value));
    EXPECT_EQ(result.value().counters.invalid_samples_count, 0u) << order_name(order);
    if (first.empty()) first = result.value().rgba;
    EXPECT_EQ(std::memcmp(first.data(), result.value().rgba.data(), first.size() * sizeof(float)), 0)
        << order_name(order);
  }
}

TEST(HostileGeometry, IsBuiltCountedAndTracedInMemoryAndOutOfCore) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    MemoryFileSystem fs;
    save_soup(fs, c.soup);
    const std::vector<TestTriangle> triangles = triangles_to_hit(c.soup);
    const std::vector<Ray> rays = rays_at(triangles, rays_to_try(300), 3);
    const size_t zero_area = without_area(c.soup);
    EXPECT_GE(zero_area, c.name == "degenerate" ? 250u : 0u);  // one in twelve
    SceneBuildOptions small, chunked, least = least_memory(fs);
    small.treelet_bytes = chunked.treelet_bytes = kMinTreeletBytes;
    chunked.chunk_triangles = c.soup.size() / 9;
    for (const SceneBuildOptions& options : {SceneBuildOptions{}, small, chunked, least}) {
      const BuiltScene built = build_and_open(fs, options);
      EXPECT_EQ(built.report.degenerate_count, left_out(c.soup));
      EXPECT_EQ(built.report.triangles_count, c.soup.size() - left_out(c.soup));
      EXPECT_EQ(built.report.zero_area_count, zero_area);
      if (options.chunk_triangles > 0) { EXPECT_GT(built.report.chunks_count, 4u); }
      EXPECT_GE(compare_with_every_triangle(built, triangles, rays), c.hits_at_least);
    }
    expect_one_picture(fs, build_and_open(fs, small).scene);
  }
}

TEST(HostileGeometry, AMillionTrianglesInOneUnitInTheLastPlace) {
  MemoryFileSystem fs;
  const TriangleSoup soup = in_one_ulp(1000000);
  save_soup(fs, soup);
  const std::vector<TestTriangle> triangles = triangles_to_hit(soup);
  EXPECT_EQ(triangles.size(), 8u * 7 * 6);
  const std::vector<Ray> rays = rays_at(triangles, rays_to_try(10), 3);
  const SceneBuildOptions least = least_memory(fs);
  for (const SceneBuildOptions& options : {SceneBuildOptions{}, least}) {
    const BuiltScene built = build_and_open(fs, options);
    EXPECT_EQ(built.report.triangles_count, soup.size());
    EXPECT_EQ(built.report.chunks_count > 1, options.max_memory_bytes > 0);
    compare_with_every_triangle(built, triangles, rays);
  }
}

uint32_t depth_of(const std::vector<BinaryNode>& nodes, uint32_t node) {
  return nodes[node].leaf() ? 0
                            : 1 + std::max(depth_of(nodes, nodes[node].left), depth_of(nodes, nodes[node].left + 1));
}

TEST(HostileGeometry, BinaryTreesOfSixtyLevelsAndMoreAreCutAndTraced) {
  const TriangleSoup soup = nested_octaves(240, 16);
  RefArray refs = make_refs(soup.positions);
  EXPECT_GE(depth_of(build_binary_tree(refs.refs(), {16}), 0), 60u) << "or this case is no longer deep";
}

/// A treelet of `levels` nodes in a chain, a leaf at each, every box as large as all: all of it is crossed by every ray.
std::vector<std::byte> chain_page(const std::vector<TestTriangle>& triangles) {
  PagePacker packer(4);
  std::vector<TestTriangle> copy = triangles;
  return packer.add_chain(copy), packer.finish();
}

TEST(HostileGeometry, TreeletsOfSixtyLevelsAreTraced) {
  std::mt19937 random(8);
  const auto soup = random_soup(random, 4 * (kMaxTreeletDepth - 1), 0.3f);
  for (const size_t levels : {size_t{60}, size_t{kMaxTreeletDepth - 1}}) {
    const std::vector<TestTriangle> triangles(soup.begin(), soup.begin() + static_cast<ptrdiff_t>(4 * levels));
    TestScene scene = make_scene({triangles}, {{0, {}}}, {triangles.size(), 4});
    ASSERT_EQ(scene.pages.size(), 1u);
    scene.pages[0] = AlignedPage(chain_page(triangles));
    scene.entries[0].root = 0;
    ASSERT_TRUE(check_treelet(scene.pages[0].bytes()).ok());
    const std::vector<Ray> rays = rays_at(triangles, rays_to_try(400), 9);
    const std::vector<Ray> found = trace_every_way(scene, rays);
    for (size_t i = 0; i < rays.size(); ++i) {
      Ray expected = rays[i];
      brute_force(scene, expected);
      ASSERT_EQ(expected.hit.valid(), found[i].hit.valid()) << i;
      if (expected.any_hit() || !expected.hit.valid()) continue;
      ASSERT_EQ(expected.hit.primitive, found[i].hit.primitive) << i;
      ASSERT_EQ(expected.t, found[i].t) << i;
    }
  }
}

}  // namespace
}  // namespace shoal::testing
