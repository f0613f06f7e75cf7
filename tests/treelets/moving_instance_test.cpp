// Instances that move: where they stand at a time, and that rays of every time meet them there.
#include <gtest/gtest.h>

#include <random>

#include "tests/numerics/every_kernel.h"
#include "treelets/moving_instance.h"

namespace shoal {
namespace {

using namespace testing;

constexpr uint32_t kKeys = 5;

/// `scene` with instance 0 moving from where it stands: turned about z and carried along.
struct MovingScene {
  explicit MovingScene(TestScene made) : scene(std::move(made)) {
    const auto count = static_cast<uint32_t>(scene.instances.size());
    const Bounds3 object = bounds_of(scene.objects[scene.instances[0].object]);
    Bounds3 swept;
    for (uint32_t k = 0; k < kKeys; ++k) {
      const float angle = 0.4f * static_cast<float>(k);
      Placement placement;
      placement.object = scene.instances[0].object;
      placement.object_to_world = {{std::cos(angle), std::sin(angle), 0}, {-std::sin(angle), std::cos(angle), 0.1f},
                                   {0, 0, 1.2f}, {0.5f * static_cast<float>(k), -0.2f, 0.1f}};
      Instance key = make_instance(placement, 0, object);
      key.tree_child = kNoIndex;
      key.transform_error *= 2;
      swept.include(world_bounds(key, object));
      scene.instances.push_back(key);
    }
    Instance& moving = scene.instances[0];
    moving.identity = 0, moving.motion_rows = count, moving.key_count = kKeys;
    moving.transform_error = scene.instances.back().transform_error;
    for (TopNode& node : scene.nodes) widen(node, swept);
  }
  void widen(TopNode& node, const Bounds3& swept) {
    for (int slot = 0; slot < 8; ++slot) {
      if (node.kind[slot] != ChildKind::kInstance || node.child[slot] != 0) continue;
      set_child(node, static_cast<uint32_t>(slot), ChildKind::kInstance, 0, swept);
    }
  }
  TestScene scene;
};

TestScene some_scene(std::mt19937& random) {
  Placement beside;
  beside.object = 1;
  beside.object_to_world.translation = {0.5f, 0.3f, 0};
  return make_scene({random_soup(random, 300, 0.3f), closed_mesh(10, 16, 0.2f, 300)}, {{0, {}}, beside}, {50, 4});
}

uint32_t seed_of(float time) { return static_cast<uint32_t>(time * 65536) << 16 | 77; }

TEST(MovingInstance, StandsAtItsKeysAndGoesStraightBetweenThem) {
  std::mt19937 random(1);
  const MovingScene moving(some_scene(random));
  const Instance& first = moving.scene.instances[0];
  const Instance* const keys = &first + first.motion_rows;
  for (uint32_t k = 0; k < kKeys; ++k) {
    const Instance at = instance_at(first, static_cast<float>(k) / (kKeys - 1));
    EXPECT_EQ(at.object_to_world, keys[k].object_to_world) << k;
    EXPECT_FALSE(at.moves());
    EXPECT_LT(glm::length(at.world_to_object.point(at.object_to_world.point({1, 2, 3})) - Vec3(1, 2, 3)), 1e-5f);
  }
  const Instance between = instance_at(first, 0.375f);  // halfway from the second to the third
  const Vec3 p(0.3f, -0.7f, 0.2f);
  const Vec3 middle = 0.5f * (keys[1].object_to_world.point(p) + keys[2].object_to_world.point(p));
  EXPECT_LT(glm::length(between.object_to_world.point(p) - middle), 1e-6f);
}

TEST(MovingInstance, StaysAtAKeyThatSaysSo) {
  std::mt19937 random(1);
  MovingScene moving(some_scene(random));
  Instance* const keys = &moving.scene.instances[0] + moving.scene.instances[0].motion_rows;
  keys[1].key_count = 1;
  EXPECT_EQ(instance_at(moving.scene.instances[0], 0.375f).object_to_world, keys[1].object_to_world);
  EXPECT_EQ(instance_at(moving.scene.instances[0], 0.375f).world_to_object, keys[1].world_to_object);
  EXPECT_NE(instance_at(moving.scene.instances[0], 0.6f).object_to_world, keys[2].object_to_world);
}

TEST(MovingInstance, AMapWithoutAnInverseLeavesItAsAtTheKeyBefore) {
  std::mt19937 random(1);
  MovingScene moving(some_scene(random));
  Instance* const keys = &moving.scene.instances[0] + moving.scene.instances[0].motion_rows;
  keys[1].object_to_world = keys[0].object_to_world;
  for (Vec3* column : {&keys[1].object_to_world.column_x, &keys[1].object_to_world.column_y,
                       &keys[1].object_to_world.column_z}) {
    *column = -*column;
  }
  EXPECT_EQ(instance_at(moving.scene.instances[0], 0.125f).object_to_world, keys[0].object_to_world);
}

TEST(MovingInstance, RaysOfEveryTimeMeetItWhereBruteForceMeetsItsPoseThen) {
  std::mt19937 random(2);
  const MovingScene moving(some_scene(random));
  const TestScene& scene = moving.scene;
  const auto pages = static_cast<uint32_t>(scene.pages.size());
  ASSERT_TRUE(TopTree::check(scene.nodes, scene.entries, scene.instances, pages).ok());
  const TopTree tree(scene.nodes, scene.entries, scene.instances);
  EXPECT_EQ(tree.instance_count(), 2u);
  EXPECT_TRUE(tree.moves());
  size_t hits = 0, of_the_moving_one = 0;
  for (int i = 0; i < 4000; ++i) {
    const float time = static_cast<float>(random() % 65536) / 65536;
    const Vec3 origin = random_vector(random, 4.0f);
    Ray ray = make_ray(origin, random_vector(random, 1.0f) - origin + Vec3(time, 0, 0), kRayInfinity, i % 4 == 0);
    ray.alpha_seed = seed_of(time);
    TestScene still = {{}, {}, {instance_at(scene.instances[0], ray.time()), scene.instances[1]}, {}, scene.objects};
    Ray expected = ray;
    brute_force(still, expected);
    trace_scene(tree, scene.pages, ray, trace_treelet);
    ASSERT_EQ(ray.hit.valid(), expected.hit.valid()) << i;
    hits += ray.hit.valid(), of_the_moving_one += ray.hit.valid() && ray.hit.instance == 0;
    if (ray.any_hit() || !ray.hit.valid()) continue;
    EXPECT_EQ(ray.t, expected.t) << i;
    EXPECT_EQ(ray.hit.instance, expected.hit.instance) << i;
    EXPECT_EQ(ray.hit.primitive, expected.hit.primitive) << i;
  }
  EXPECT_GT(hits, 800u);
  EXPECT_GT(of_the_moving_one, 200u);
}

TEST(MovingInstance, EveryKernelOnEveryInstructionSetMeetsItAlike) {
  std::mt19937 random(4);
  const MovingScene moving(some_scene(random));
  std::vector<Ray> rays;
  for (int i = 0; i < 2000; ++i) {
    const Vec3 origin = random_vector(random, 4.0f);
    rays.push_back(make_ray(origin, random_vector(random, 1.0f) - origin, kRayInfinity, i % 4 == 0));
    rays.back().alpha_seed = static_cast<uint32_t>(random());
  }
  size_t of_the_moving_one = 0;
  for (const Ray& ray : trace_every_way(moving.scene, rays)) of_the_moving_one += ray.hit.valid() && ray.hit.instance == 0;
  EXPECT_GT(of_the_moving_one, 200u);
}

TEST(MovingInstance, TablesThatNameNoKeysAreRefused) {
  std::mt19937 random(3);
  const auto refused = [&](auto change) {
    MovingScene moving(some_scene(random));
    change(moving.scene.instances);
    return TopTree::check(moving.scene.nodes, moving.scene.entries, moving.scene.instances,
                          static_cast<uint32_t>(moving.scene.pages.size()))
               .ok() == false;
  };
  EXPECT_FALSE(refused([](auto&) {}));
  EXPECT_TRUE(refused([](auto& rows) { rows[0].key_count = 1; }));
  EXPECT_TRUE(refused([](auto& rows) { rows[0].key_count = kKeys + 1; }));
  EXPECT_TRUE(refused([](auto& rows) { rows[0].motion_rows = 1; }));
  EXPECT_TRUE(refused([](auto& rows) { rows[0].motion_rows = 0xffffffffu; }));
  EXPECT_TRUE(refused([](auto& rows) { rows[0].identity = 1; }));
  EXPECT_TRUE(refused([](auto& rows) { rows[3].motion_rows = 1, rows[3].key_count = 2; }));
  EXPECT_TRUE(refused([](auto& rows) { rows[4].tree_child = 0; }));
  EXPECT_FALSE(refused([](auto& rows) { rows[4].key_count = 1; }));
  EXPECT_TRUE(refused([](auto& rows) { rows[4].key_count = 2; }));
  EXPECT_TRUE(refused([](auto& rows) { rows[5].object_to_world.translation.x = NAN; }));
}

TEST(MovingInstance, ATableOfKeysAloneIsRefused) {
  // Nothing shows the key, so nothing else would look at the tree that it names.
  TopNode empty{};
  empty.parent = kNoIndex;
  for (auto& kind : empty.kind) kind = ChildKind::kEmpty;
  Instance key{};
  key.identity = 1, key.tree_child = kNoIndex, key.root_node = 0x1fffffff;
  EXPECT_FALSE(TopTree::check(std::vector{empty}, {}, std::vector{key}, 0).ok());
  EXPECT_TRUE(TopTree::check(std::vector{empty}, {}, {}, 0).ok());
}

}  // namespace
}  // namespace shoal
