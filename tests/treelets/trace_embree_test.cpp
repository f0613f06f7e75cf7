// Against Embree, and against daylight: nothing leaks through a closed mesh.
#include <gtest/gtest.h>

#include "tests/support/embree_peer.h"
#include "tests/support/hand_made_scene.h"

namespace shoal::testing {
namespace {

void compare_with_embree(const std::vector<TestTriangle>& triangles, std::mt19937& random) {
  const TestScene scene = make_scene({triangles}, {{0, {}}}, {300, 4});
  const TopTree tree(scene.nodes, scene.entries, scene.instances);
  const EmbreePeer embree(triangles, true);
  constexpr int kRays = 30000;
  int hits = 0, differences = 0;
  for (int i = 0; i < kRays; ++i) {
    const Vec3 origin = random_vector(random, 2), target = random_vector(random);
    Ray ray = make_ray(origin, target - origin);
    float t;
    const uint32_t expected = embree.intersect(ray, t);
    trace_scene(tree, scene.pages, ray, trace_treelet);
    hits += ray.hit.valid();
    const bool same_t = ray.hit.valid() && std::abs(ray.t - t) <= 1e-5f * (1 + t);
    differences += expected == RTC_INVALID_GEOMETRY_ID ? ray.hit.valid() : !same_t;
  }
  EXPECT_GT(hits, kRays / 10);
  EXPECT_LE(differences, kRays / 10000);  // rays within rounding of an edge
}

TEST(TraceEmbree, FindsTheSameHitsInSoupsAndMeshes) {
  std::mt19937 random(1);
  compare_with_embree(random_soup(random, 5000, 0.1f), random);
  compare_with_embree(random_soup(random, 3000, 0.5f), random);
  compare_with_embree(closed_mesh(40, 80, 0.2f), random);
}

TEST(TraceLeaks, NoRayLeavesAClosedMeshThroughItsEdgesOrVertices) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (const Vec3 shift : {Vec3(0), Vec3(100, -30, 7)}) {
    auto mesh = closed_mesh(60, 120, 0.05f);
    for (auto& t : mesh) {
      for (auto& p : t.p) p += shift;
    }
    const TestScene scene = make_scene({mesh}, {{0, {}}}, {500, 4});
    const TopTree tree(scene.nodes, scene.entries, scene.instances);
    size_t leaks = 0;
    for (int i = 0; i < 100000; ++i) {
      const TestTriangle& t = mesh[random() % mesh.size()];
      const Vec3 origin = shift + random_vector(random, 0.3f);
      const Vec3 target = i % 2 ? t.p[random() % 3] : t.p[0] + (t.p[1] - t.p[0]) * uniform(random);
      Ray ray = make_ray(origin, target - origin);
      trace_scene(tree, scene.pages, ray, trace_treelet);
      leaks += !ray.hit.valid();
    }
    EXPECT_EQ(leaks, 0u);
  }
}

}  // namespace
}  // namespace shoal::testing
