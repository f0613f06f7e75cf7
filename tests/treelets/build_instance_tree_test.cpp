#include <gtest/gtest.h>

#include <functional>

#include "tests/support/sample_soups.h"
#include "treelets/build_object.h"

namespace shoal {
namespace {

// Visits the leaves; checks links, levels and that boxes lie inside those above.
uint32_t walk(const std::vector<TopNode>& nodes, const std::function<void(uint32_t, const Bounds3&)>& visit) {
  uint32_t deepest = 0;
  size_t visited = 0;
  const std::function<void(uint32_t, uint32_t, uint32_t, const Bounds3&)> step =
      [&](uint32_t index, uint32_t parent, uint32_t level, const Bounds3& above) {
        ASSERT_LT(index, nodes.size());
        ++visited;
        const TopNode& node = nodes[index];
        EXPECT_EQ(node.parent, parent);
        EXPECT_EQ(node.level, level);
        deepest = std::max(deepest, level);
        for (uint32_t slot = 0; slot < 8; ++slot) {
          if (node.kind[slot] == ChildKind::kEmpty) {
            EXPECT_GT(node.lo[0][slot], node.hi[0][slot]);
            continue;
          }
          const Bounds3 box{{node.lo[0][slot], node.lo[1][slot], node.lo[2][slot]},
                            {node.hi[0][slot], node.hi[1][slot], node.hi[2][slot]}};
          for (int axis = 0; axis < 3; ++axis) {
            EXPECT_GE(box.lo[axis], above.lo[axis]);
            EXPECT_LE(box.hi[axis], above.hi[axis]);
          }
          if (node.kind[slot] == ChildKind::kNode) {
            step(node.child[slot], index << 3 | slot, level + 1, box);
          } else {
            EXPECT_EQ(node.kind[slot], ChildKind::kInstance);
            visit(node.child[slot], box);
          }
        }
      };
  const float inf = std::numeric_limits<float>::infinity();
  step(0, kNoIndex, 0, {Vec3(-inf), Vec3(inf)});
  EXPECT_EQ(visited, nodes.size());
  return deepest;
}

void expect_holds(const std::vector<InstanceBounds>& instances) {
  std::vector<int> seen(instances.size(), 0);
  walk(build_instance_tree(instances), [&](uint32_t i, const Bounds3& box) {
    ++seen[i];
    EXPECT_EQ(box.lo, instances[i].bounds.lo);
    EXPECT_EQ(box.hi, instances[i].bounds.hi);
  });
  for (const int times : seen) EXPECT_EQ(times, 1);
}

TEST(BuildInstanceTree, HoldsEveryInstanceOnceWithItsBox) {
  testing::Numbers numbers(1);
  for (const uint32_t count : {1u, 2u, 8u, 9u, 5000u}) {
    std::vector<InstanceBounds> instances;
    for (uint32_t i = 0; i < count; ++i) {
      const Vec3 p(numbers.uniform(-5, 5), numbers.uniform(-5, 5), numbers.uniform(-5, 5));
      instances.push_back({i, {p, p + Vec3(numbers.uniform(0, 1))}});
    }
    expect_holds(instances);
  }
}

TEST(BuildInstanceTree, IsOneNodeWithoutChildrenWhenEmpty) {
  for (const std::vector<InstanceBounds>& none : {std::vector<InstanceBounds>{}, {InstanceBounds{7, Bounds3{}}}}) {
    const std::vector<TopNode> nodes = build_instance_tree(none);
    ASSERT_EQ(nodes.size(), 1u);
    EXPECT_EQ(nodes[0].parent, kNoIndex);
    for (int slot = 0; slot < 8; ++slot) {
      EXPECT_EQ(nodes[0].kind[slot], ChildKind::kEmpty);
      EXPECT_GT(nodes[0].lo[0][slot], nodes[0].hi[0][slot]);
    }
  }
}

TEST(BuildInstanceTree, StaysShallowOverEqualBoxes) {
  const std::vector<InstanceBounds> instances = [] {
    std::vector<InstanceBounds> same(100000);
    for (uint32_t i = 0; i < same.size(); ++i) same[i] = {i, {Vec3(0), Vec3(1)}};
    return same;
  }();
  uint64_t found = 0;
  EXPECT_LE(walk(build_instance_tree(instances), [&](uint32_t, const Bounds3&) { ++found; }), 8u);
  EXPECT_EQ(found, instances.size());
}

TEST(BuildInstanceTree, TakesBoxesThatAreNotFinite) {
  const float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  const float largest = std::numeric_limits<float>::max();
  const std::vector<InstanceBounds> instances = {{0, {Vec3(-inf), Vec3(inf)}},
                                                 {1, {Vec3(nan), Vec3(nan)}},
                                                 {2, {Vec3(-largest), Vec3(largest)}},
                                                 {3, {Vec3(0), Vec3(1)}}};
  int found = 0;
  walk(build_instance_tree(instances), [&](uint32_t i, const Bounds3& box) {
    ++found;
    EXPECT_EQ(box.hi.x, i < 3 ? largest : 1.0f);
    EXPECT_FALSE(box.empty());
  });
  EXPECT_EQ(found, 4);
}

}  // namespace
}  // namespace shoal
