#include <gtest/gtest.h>

#include <random>

#include "engine/emitters.h"
#include "engine/place_instances.h"
#include "tests/engine/built_scene.h"

namespace shoal::testing {
namespace {

AffineDouble random_map(std::mt19937& random, double scale) {
  std::normal_distribution<double> normal;
  AffineDouble map;
  for (auto& column : map.column) {
    for (double& v : column) v = normal(random) * scale;
  }
  for (double& v : map.translation) v = normal(random) * 100;
  return map;
}

TEST(Instances, AMeshThatSeveralNodesShareIsStoredOnce) {
  MemoryFileSystem fs;
  WrittenScene scene;
  const uint32_t shared = scene.add_triangle_mesh(0, 1), single = scene.add_triangle_mesh(3, 1);
  scene.add_node({{"mesh", shared}, {"translation", {0, 0, 1}}});
  scene.add_node({{"mesh", single}});
  scene.add_node({{"mesh", shared}, {"translation", {0, 0, 2}}, {"scale", {-1, 1, 1}}});
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  EXPECT_EQ(built.scene.header.triangles_count, 2u);
  EXPECT_EQ(built.scene.header.instanced_triangles_count, 3u);
  ASSERT_EQ(built.scene.top_tree.instance_count(), 3u);
  const auto instances = built.scene.top_tree.instances();
  EXPECT_EQ(instances[0].identity, 1u);  // the world object: the mesh that one node shows
  EXPECT_EQ(built.objects[0][0].primitive, 1u);
  EXPECT_EQ(built.objects[1][0].primitive, 0u);
  EXPECT_EQ(instances[1].root_node, instances[2].root_node);
  EXPECT_EQ(instances[1].object_to_world.translation, Vec3(0, 0, 1));
  EXPECT_EQ(instances[2].object_to_world.column_x, Vec3(-1, 0, 0));
  EXPECT_EQ(instances[2].transform_error, 1.0f);
}

TEST(Instances, TheWorldFindsEveryInstanceWithARay) {
  MemoryFileSystem fs;
  WrittenScene scene;
  const uint32_t shared = scene.add_triangle_mesh(0, 1);
  constexpr int kSide = 6;
  for (int i = 0; i < kSide * kSide; ++i) {
    scene.add_node(
        {{"mesh", shared}, {"translation", {3 * (i % kSide), 3 * (i / kSide), i}}, {"scale", {2, 2, 2}}});
  }
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  for (int i = 0; i < kSide * kSide; ++i) {
    Ray ray;
    ray.origin =
        Vec3(3.0f * static_cast<float>(i % kSide) + 0.5f, 3.0f * static_cast<float>(i / kSide) + 0.5f, 1000);
    ray.direction = Vec3(0, 0, -1);
    ray.t = kRayInfinity;
    uint64_t tests = 0;
    ASSERT_NE(built.scene.top_tree.next(ray, tests), kNoIndex) << i;
    EXPECT_EQ(ray.instance, static_cast<uint32_t>(i));
  }
}

TEST(Instances, ASharedMeshSquashedFlatIsLeftOutWithAWarning) {
  MemoryFileSystem fs;
  WrittenScene scene;
  const uint32_t shared = scene.add_triangle_mesh(0, 1);
  scene.add_node({{"mesh", shared}});
  scene.add_node({{"mesh", shared}, {"scale", {1, 0, 1}}});
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  EXPECT_EQ(built.scene.top_tree.instance_count(), 1u);
  ASSERT_FALSE(built.report.warnings.empty());
  EXPECT_NE(built.report.warnings.back().find("no inverse"), std::string::npos);
}

TEST(Instances, BoundsEncloseWhatTheInstanceShows) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> unit(0, 1);
  for (int round = 0; round < 200; ++round) {
    const AffineDouble map = random_map(random, round % 2 ? 1e-3 : 50);
    Bounds3 box;
    for (int i = 0; i < 2; ++i) box.include(Vec3(unit(random), 1000 * unit(random), -unit(random)));
    const auto placed = place_instance(0, box, map);
    ASSERT_TRUE(placed.has_value());
    const Affine3& to_world = placed->instance.object_to_world;
    for (int i = 0; i < 50; ++i) {
      Vec3 p;
      for (int axis = 0; axis < 3; ++axis)
        p[axis] = i < 8 ? ((i >> axis) & 1 ? box.hi : box.lo)[axis]
                        : std::clamp(box.lo[axis] + unit(random) * box.extent()[axis], box.lo[axis], box.hi[axis]);
      for (const Vec3& world :
           {to_world.point(p),
            rounded({{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}, widened(to_world).point({p.x, p.y, p.z})}).translation}) {
        for (int axis = 0; axis < 3; ++axis) {
          EXPECT_GE(world[axis], placed->bounds.lo[axis]);
          EXPECT_LE(world[axis], placed->bounds.hi[axis]);
        }
      }
    }
  }
}

TEST(Instances, TheInverseBelongsToTheRoundedMap) {
  std::mt19937 random(8);
  for (int round = 0; round < 200; ++round) {
    const AffineDouble map = random_map(random, 3);
    const auto placed = place_instance(0, {Vec3(0), Vec3(1)}, map);
    ASSERT_TRUE(placed.has_value());
    const AffineDouble product =
        multiply(inverse(widened(placed->instance.object_to_world)), widened(placed->instance.object_to_world));
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) EXPECT_NEAR(product.column[i][j], i == j, 1e-9);
    }
    // Row sums of |M||M^-1| are at least 1: the diagonal of their product holds sums that M M^-1 = 1 bounds below.
    EXPECT_GE(placed->instance.transform_error, 1.0f);
  }
}

TEST(Instances, EmittersAreWhereShadingSeesThem) {
  MemoryFileSystem fs;
  WrittenScene scene;
  scene.json["materials"] = {{{"emissiveFactor", {1, 0.5, 0}},
                              {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 4.0}}}}}},
                             {{"name", "dark"}}};
  scene.json["extensionsUsed"] = {"KHR_materials_emissive_strength"};
  const uint32_t shared = scene.add_triangle_mesh(0.1f, 1.3f), dark = scene.add_triangle_mesh(0, 1);
  const uint32_t baked = scene.add_triangle_mesh(7, 1);
  scene.json["meshes"][shared]["primitives"][0]["material"] = 0;
  scene.json["meshes"][dark]["primitives"][0]["material"] = 1;
  scene.json["meshes"][baked]["primitives"][0]["material"] = 0;
  scene.add_node({{"mesh", shared}, {"translation", {0.3, 0, 1}}, {"scale", {0.7, 1.1, 1}}});
  scene.add_node({{"mesh", dark}});
  scene.add_node({{"mesh", baked}, {"translation", {0, 1, 0}}});
  scene.add_node({{"mesh", shared}, {"translation", {0, 0.2, 2}}});
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  EXPECT_FLOAT_EQ(built.scene.materials[0].emissive[1], 2.0f);
  EXPECT_FLOAT_EQ(built.scene.materials[0].emission_weight, 4 * 0.2126f + 2 * 0.7152f);
  EXPECT_EQ(built.scene.materials[1].flags & kMaterialEmits, 0u);
  ASSERT_EQ(built.scene.emitters.size(), 3u);
  for (uint32_t i = 0; i < 3; ++i) {
    const Emitter& e = built.scene.emitters[i];
    EXPECT_EQ(e.instance, i);
    const Instance& instance = built.scene.top_tree.instance(i);
    for (const ReadTriangle& t : built.objects[instance.object]) {
      if (t.primitive != e.primitive) continue;
      for (int k = 0; k < 3; ++k) {
        Vec3 p(t.position[3 * k], t.position[3 * k + 1], t.position[3 * k + 2]);
        if (!instance.identity) p = instance.object_to_world.point(p);
        for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(e.position[3 * k + axis], p[axis]);
      }
    }
  }
}

TEST(Instances, EmittersWithoutAreaAreLeftOut) {
  Emitter flat = {}, tiny = {};
  const float line[9] = {0, 0, 0, 1, 1, 1, 2, 2, 2}, small[9] = {0, 0, 0, 1e-30f, 0, 0, 0, 1e-30f, 0};
  std::copy_n(line, 9, flat.position);
  std::copy_n(small, 9, tiny.position);
  Instance identity = {};
  identity.identity = 1;
  std::vector<Emitter> out;
  ASSERT_TRUE(append_emitters(std::vector{flat, tiny}, identity, 5, out).ok());
  ASSERT_EQ(out.size(), 1u);
  EXPECT_EQ(out[0].instance, 5u);
  EXPECT_EQ(out[0].position[3], 1e-30f);
}

TEST(Instances, CamerasAndLightsGoThroughTheirNodes) {
  MemoryFileSystem fs;
  WrittenScene scene;
  scene.json["cameras"] = {
      {{"type", "perspective"}, {"perspective", {{"yfov", 1.5707963267948966}, {"znear", 0.1}}}}};
  scene.json["extensionsUsed"] = {"KHR_lights_punctual"};
  scene.json["extensions"]["KHR_lights_punctual"]["lights"] = {
      {{"type", "spot"},
       {"color", {1, 0.5, 0.25}},
       {"intensity", 8},
       {"spot", {{"outerConeAngle", 1.0471975511965976}}}}};
  scene.add_node({{"mesh", scene.add_triangle_mesh(0, 1)}});
  scene.add_node({{"camera", 0}, {"translation", {1, 2, 3}}});
  scene.add_node({{"rotation", {0.70710678118, 0, 0, 0.70710678118}},  // a quarter turn about x: -z becomes +y
                  {"scale", {2, 2, 2}},
                  {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  ASSERT_EQ(built.scene.cameras.size(), 1u);
  EXPECT_NEAR(built.scene.cameras[0].tan_half_yfov, 1, 1e-6);
  EXPECT_EQ(built.scene.cameras[0].camera_to_world.translation, Vec3(1, 2, 3));
  ASSERT_EQ(built.scene.lights.size(), 1u);
  const PunctualLight& light = built.scene.lights[0];
  EXPECT_EQ(light.type, PunctualType::kSpot);
  EXPECT_NEAR(light.direction[1], 1, 1e-6);
  EXPECT_FLOAT_EQ(light.intensity[2], 2);
  EXPECT_NEAR(light.cos_outer, 0.5, 1e-6);
  EXPECT_NEAR(light.cos_inner, 1, 1e-6);
}

}  // namespace
}  // namespace shoal::testing
