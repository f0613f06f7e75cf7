// The three ways of --triangle-test: each gives the same bits in every kernel on every instruction set, and finds what
// brute force over all triangles finds, whatever the tree.
#include <gtest/gtest.h>

#include "tests/numerics/every_kernel.h"
#include "tests/support/built_scene.h"

namespace shoal::testing {
namespace {

/// Half at random, half at edges and corners, from far and near.
std::vector<Ray> rays_at(const std::vector<TestTriangle>& triangles, std::mt19937& random, size_t count) {
  std::uniform_real_distribution<float> uniform(0, 1);
  std::vector<Ray> rays;
  for (size_t i = 0; i < count; ++i) {
    const TestTriangle& aim = triangles[random() % triangles.size()];
    const Vec3 origin = random_vector(random, i % 7 == 0 ? 1e4f : 2.0f);
    Vec3 target = random_vector(random);
    if (i % 4 == 1) target = aim.p[random() % 3];
    if (i % 4 == 3) target = aim.p[0] + (aim.p[1] - aim.p[0]) * uniform(random);
    rays.push_back(make_ray(origin, target - origin, kRayInfinity, i % 5 == 0));
  }
  return rays;
}

void expect_what_brute_force_finds(const TestScene& scene, const std::vector<Ray>& rays, TriangleTest test) {
  const std::vector<Ray> found = trace_every_way(scene, rays, test);
  size_t hits = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    Ray expected = rays[i];
    brute_force(scene, expected, test);
    ASSERT_EQ(expected.hit.valid(), found[i].hit.valid()) << triangle_test_name(test) << ", ray " << i;
    hits += expected.hit.valid();
    if (expected.any_hit() || !expected.hit.valid()) continue;
    ASSERT_EQ(expected.t, found[i].t) << triangle_test_name(test) << ", ray " << i;
    ASSERT_EQ(expected.hit.instance, found[i].hit.instance);
    ASSERT_EQ(expected.hit.primitive, found[i].hit.primitive);
  }
  EXPECT_GT(hits, rays.size() / 10);
}

constexpr TriangleTest kKinds[] = {TriangleTest::kFast, TriangleTest::kWatertight, TriangleTest::kDouble};

TEST(TriangleTestKinds, FindWhatBruteForceFindsInEveryKernelAndTree) {
  for (const TriangleTest test : kKinds) {
    std::mt19937 random(1);
    const auto soup = random_soup(random, 1500, 0.2f);
    const auto mesh = closed_mesh(16, 32, 0.2f);
    for (const uint32_t treelet_bytes : {4u << 10, 256u << 10}) {
      expect_what_brute_force_finds(build_scene({soup}, {{0, {}}}, treelet_bytes), rays_at(soup, random, 1000), test);
      expect_what_brute_force_finds(build_scene({mesh}, {{0, {}}}, treelet_bytes), rays_at(mesh, random, 1000), test);
    }
  }
}

TEST(TriangleTestKinds, FindWhatBruteForceFindsAmongInstances) {
  for (const TriangleTest test : kKinds) {
    std::mt19937 random(2);
    const auto mesh = closed_mesh(10, 16, 0.2f);
    std::vector<Placement> placements{{0, {}}};
    for (int i = 0; i < 12; ++i) {  // turned, scaled, sheared, mirrored
      Placement p;
      p.object_to_world = {random_vector(random), random_vector(random), random_vector(random, i % 4 == 0 ? 0.01f : 1.0f),
                           random_vector(random, i % 5 == 0 ? 50.0f : 2.0f)};
      placements.push_back(p);
    }
    expect_what_brute_force_finds(make_scene({mesh}, placements, {50, 4}), rays_at(mesh, random, 1000), test);
  }
}

TEST(TriangleTestKinds, DifferByNoMoreThanRoundingOnOpenSurfaces) {
  std::mt19937 random(3);
  const auto soup = random_soup(random, 1500, 0.2f);
  const TestScene scene = make_scene({soup}, {{0, {}}}, {200, 4});
  std::vector<Ray> rays;
  for (int i = 0; i < 3000; ++i) rays.push_back(make_ray(random_vector(random, 2), random_vector(random)));
  std::vector<std::vector<Ray>> found;
  for (const TriangleTest test : kKinds) found.push_back(trace_every_way(scene, rays, test));
  size_t same = 0, alike = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    same += found[0][i].hit.primitive == found[2][i].hit.primitive;
    alike += found[1][i].hit.primitive == found[2][i].hit.primitive && std::abs(found[1][i].t / found[2][i].t - 1) < 1e-4f;
  }
  EXPECT_GE(same, rays.size() - 3);
  EXPECT_GE(alike, rays.size() - 3);
}

}  // namespace
}  // namespace shoal::testing
