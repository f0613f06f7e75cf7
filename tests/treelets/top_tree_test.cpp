// The resident top tree: order of entries, independence of Ray::more, and checks of tables from strangers.
#include "treelets/top_tree.h"

#include <gtest/gtest.h>

#include "tests/support/hand_made_scene.h"

namespace shoal::testing {
namespace {

TestScene instanced_scene(std::mt19937& random, size_t treelet_triangles = 10) {
  const auto a = random_soup(random, 400, 0.2f), b = random_soup(random, 100, 0.4f, 400);
  std::vector<Placement> placements{{0, {}}};
  for (int i = 0; i < 40; ++i) {
    Placement p;
    p.object = random() % 2;
    p.object_to_world = {random_vector(random), random_vector(random), random_vector(random),
                         random_vector(random, 3)};
    placements.push_back(p);
  }
  return make_scene({a, b}, placements, {treelet_triangles, 4});
}

Status check(const TestScene& scene) {
  return TopTree::check(scene.nodes, scene.entries, scene.instances, static_cast<uint32_t>(scene.pages.size()));
}

TEST(TopTree, VisitsTheSameEntriesWithAnyNumberOfMoreLevels) {
  std::mt19937 random(1);
  const TestScene scene = instanced_scene(random);
  ASSERT_TRUE(check(scene).ok());
  for (int i = 0; i < 300; ++i) {
    const Vec3 origin = random_vector(random, 4);
    const Ray start = make_ray(origin, random_vector(random) - origin);
    std::vector<uint32_t> expected;
    for (const uint32_t more_levels : {32u, 0u, 1u, 2u, 3u, 5u}) {
      const TopTree tree(scene.nodes, scene.entries, scene.instances, {more_levels});
      Ray ray = start;
      std::vector<uint32_t> visited;
      trace_scene(tree, scene.pages, ray, trace_treelet, &visited);
      if (more_levels == 32) expected = visited;
      EXPECT_EQ(visited, expected) << "ray " << i << ", levels " << more_levels;
    }
  }
}

TEST(TopTree, FewerMoreLevelsCostMoreTests) {
  std::mt19937 random(2);
  const TestScene scene = instanced_scene(random);
  uint64_t tests[2] = {};
  for (const uint32_t levels : {0u, 32u}) {
    const TopTree tree(scene.nodes, scene.entries, scene.instances, {levels});
    std::mt19937 rays(3);
    for (int i = 0; i < 100; ++i) {
      Ray ray = make_ray(random_vector(rays, 4), random_vector(rays));
      while (tree.next(ray, tests[levels == 32]) != kNoIndex) {
      }
    }
  }
  EXPECT_LT(tests[1], tests[0]);
}

TEST(TopTree, AContextKeptBetweenCallsChangesNothing) {
  std::mt19937 random(4);
  const TestScene scene = instanced_scene(random);
  const TopTree tree(scene.nodes, scene.entries, scene.instances);
  for (int i = 0; i < 200; ++i) {
    Ray plain = make_ray(random_vector(random, 4), random_vector(random)), kept = plain;
    trace_scene(tree, scene.pages, plain, trace_treelet);
    RayContext context;
    TraceCounters counters;
    for (uint32_t entry; (entry = tree.next(kept, context, counters.node_tests_count)) != kNoIndex;) {
      const TreeletEntry& e = tree.entry(entry);
      EXPECT_EQ(&tree.current(kept), &e);
      trace_treelet(scene.pages[e.treelet].bytes(), e, tree.instance(kept.instance), kept, context, counters);
    }
    EXPECT_EQ(std::memcmp(&plain, &kept, sizeof(Ray)), 0) << "ray " << i;
  }
}

TEST(TopTree, EntersEntriesFrontToBack) {
  std::vector<TestTriangle> row;
  for (uint32_t i = 0; i < 200; ++i) {
    const float x = static_cast<float>(i);
    row.push_back({{{x, -1, -1}, {x, 2, -1}, {x, -1, 2}}, i});
  }
  const TestScene scene = make_scene({row}, {{0, {}}}, {3, 3});
  const TopTree tree(scene.nodes, scene.entries, scene.instances);
  for (const float sign : {1.0f, -1.0f}) {
    Ray ray = make_ray({sign > 0 ? -5.0f : 500.0f, 0, 0}, {sign, 0, 0});
    uint64_t tests = 0;
    std::vector<float> found;
    for (uint32_t entry; (entry = tree.next(ray, tests)) != kNoIndex;) {
      const TreeletTriangle t =
          find_triangle(scene.pages[tree.entry(entry).treelet].bytes(), leaf_offset(tree.entry(entry).root) << 4);
      found.push_back(sign * t.p0.x);
    }
    EXPECT_EQ(found.size(), scene.entries.size());
    EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
    EXPECT_EQ(ray.cursor, kNoIndex);
  }
}

TEST(TopTree, StopsAtTheEndOfTheRay) {
  std::mt19937 random(5);
  const TestScene scene = make_scene({random_soup(random, 500, 0.1f)}, {{0, {}}}, {10, 4});
  const TopTree tree(scene.nodes, scene.entries, scene.instances);
  Ray ray = make_ray({-5, 0, 0}, {1, 0, 0}, 3.0f);
  uint64_t tests = 0;
  EXPECT_EQ(tree.next(ray, tests), kNoIndex);
  EXPECT_EQ(tests, 1u);
}

TEST(TopTree, AnEmptySceneIsMissed) {
  const TopTree tree({}, {}, {});
  Ray ray = make_ray({0, 0, 0}, {1, 0, 0});
  uint64_t tests = 0;
  EXPECT_EQ(tree.next(ray, tests), kNoIndex);
  EXPECT_TRUE(tree.bounds().empty());
  EXPECT_TRUE(TopTree::check({}, {}, {}, 0).ok());
}

TEST(TopTree, RejectsLinksThatDoNotFit) {
  std::mt19937 random(6);
  const TestScene good = instanced_scene(random);
  ASSERT_TRUE(check(good).ok());
  const auto rejects = [&](const char* what, auto&& damage) {
    TestScene bad = good;
    damage(bad);
    const Status status = check(bad);
    ASSERT_FALSE(status.ok()) << what;
    EXPECT_EQ(status.error().code, ErrorCode::kCorrupt) << what;
  };
  const uint32_t root = good.instances[0].root_node;
  rejects("root node out of range", [](TestScene& s) { s.instances[3].root_node = 1u << 30; });
  rejects("root node is the instances' root", [](TestScene& s) { s.instances[3].root_node = 0; });
  rejects("root node is an inner node", [&](TestScene& s) { s.instances[3].root_node = root + 1; });
  rejects("tree child of another instance",
          [](TestScene& s) { s.instances[3].tree_child = s.instances[4].tree_child; });
  rejects("tree child out of range", [](TestScene& s) { s.instances[3].tree_child = 0xfffffff0u; });
  rejects("a matrix that is not finite", [](TestScene& s) { s.instances[3].world_to_object.translation.y = NAN; });
  rejects("entry of no treelet", [](TestScene& s) { s.entries[0].treelet = 1u << 20; });
  rejects("child node out of range", [&](TestScene& s) { s.nodes[root].child[0] = 1u << 28; });
  rejects("a cycle", [&](TestScene& s) { s.nodes[root].child[0] = root; });
  rejects("another parent", [&](TestScene& s) { s.nodes[s.nodes[root].child[0]].parent ^= 1; });
  rejects("another level", [&](TestScene& s) { s.nodes[s.nodes[root].child[0]].level += 1; });
  rejects("an unknown kind", [&](TestScene& s) { s.nodes[root].kind[0] = static_cast<ChildKind>(7); });
  rejects("an instance inside an object", [&](TestScene& s) { s.nodes[root].kind[0] = ChildKind::kInstance; });
  rejects("an entry among instances", [](TestScene& s) { s.nodes[0].kind[0] = ChildKind::kEntry; });
  rejects("a box that is not finite", [&](TestScene& s) { s.nodes[root].hi[1][0] = INFINITY; });
  rejects("a root below another node", [](TestScene& s) { s.nodes[0].parent = 8; });
}

TEST(TopTree, WhatPassesTheCheckIsWalkedToAnEndWhateverItsNumbers) {
  std::mt19937 random(7);
  const TestScene good = instanced_scene(random, 20);
  size_t passed = 0;
  for (int i = 0; i < 2000; ++i) {
    TestScene bad = good;
    const auto damage = [&](void* at, size_t bytes) {
      uint32_t word;
      const size_t place = random() % (bytes / 4) * 4;
      std::memcpy(&word, static_cast<char*>(at) + place, 4);
      word = random() % 3 == 0 ? static_cast<uint32_t>(random()) : word ^ 1u << random() % 32;
      std::memcpy(static_cast<char*>(at) + place, &word, 4);
    };
    for (uint32_t k = random() % 3 + 1; k > 0; --k) {
      if (random() % 4 == 0)
        damage(bad.instances.data(), bad.instances.size() * sizeof(Instance));
      else
        damage(bad.nodes.data(), bad.nodes.size() * sizeof(TopNode));
    }
    if (!check(bad).ok()) continue;
    ++passed;
    const TopTree tree(bad.nodes, bad.entries, bad.instances);
    for (int r = 0; r < 5; ++r) {
      Ray ray = make_ray(random_vector(random, 4), random_vector(random));
      uint64_t tests = 0;
      size_t entries = 0;
      while (tree.next(ray, tests) != kNoIndex) ++entries;
      EXPECT_LE(entries, bad.entries.size() * bad.instances.size());
    }
  }
  EXPECT_GT(passed, 200u);
}

}  // namespace
}  // namespace shoal::testing
