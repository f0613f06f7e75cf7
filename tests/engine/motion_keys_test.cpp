// Nodes that move while the shutter is open: what the build makes of them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "engine/light_sampler.h"
#include "engine/motion_keys.h"
#include "engine/place_instances.h"
#include "tests/engine/built_scene.h"
#include "treelets/moving_instance.h"

namespace shoal::testing {
namespace {

using ::testing::HasSubstr;
using DVec3 = glm::dvec3;

/// A triangle below a node that an animation of one channel moves, and one that stands still beside it.
struct MovingScene {
  WrittenScene scene;
  MovingScene(const char* path, uint32_t width, const std::vector<float>& times, const std::vector<float>& values) {
    scene.add_node({{"mesh", scene.add_triangle_mesh(0, 1)}});
    scene.add_node({{"mesh", scene.add_triangle_mesh(5, 1)}});
    const uint32_t input = scene.add_floats(1, times), output = scene.add_floats(width, values);
    scene.json["animations"] = {{{"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", path}}}}}},
                                 {"samplers", {{{"input", input}, {"output", output}}}}}};
  }
  BuiltScene build(double time, double open, double close) const {
    MemoryFileSystem fs;
    scene.save(fs);
    SceneBuildOptions options;
    options.pose.time = time;
    options.pose.shutter = {open, close};
    return build_and_open(fs, options);
  }
};

TEST(MotionKeys, AMeshThatMovesIsAnObjectOfItsOwnThatGoesFromOpeningToClosing) {
  const MovingScene moving("translation", 3, {0, 4}, {0, 0, 0, 8, 0, 0});
  const BuiltScene built = moving.build(1, 0.5, 1);
  const TopTree& tree = built.scene.top_tree;
  ASSERT_EQ(tree.instance_count(), 2u);
  EXPECT_FALSE(tree.instance(0).moves());  // the world, with the one that stands still
  ASSERT_TRUE(tree.instance(1).moves());
  EXPECT_EQ(instance_at(tree.instance(1), 0).object_to_world.translation, Vec3(3, 0, 0));
  EXPECT_NEAR(instance_at(tree.instance(1), 0.25f).object_to_world.translation.x, 3.25f, 1e-5f);
  EXPECT_EQ(instance_at(tree.instance(1), 1).object_to_world.translation, Vec3(4, 0, 0));
  const nlohmann::json shutter = nlohmann::json::parse(built.scene.build_record)["options"]["shutter"];
  EXPECT_EQ(shutter, (nlohmann::json{0.5, 1.0}));
  EXPECT_TRUE(built.report.warnings.empty());
}

TEST(MotionKeys, WhatStandsStillWhileTheShutterIsOpenIsBaked) {
  const MovingScene moving("translation", 3, {0, 4}, {0, 0, 0, 8, 0, 0});
  const BuiltScene built = moving.build(5, 0, 1);  // after the last key
  EXPECT_EQ(built.scene.top_tree.instance_count(), 1u);
  EXPECT_FALSE(built.scene.top_tree.moves());
  EXPECT_EQ(built.objects[0][0].position[0], 8.0f);
}

TEST(MotionKeys, ATurnHasSoManyKeysThatItStaysCloseToTheArc) {
  const float half = std::sqrt(0.5f);
  // Three quarters about z in three seconds.
  const MovingScene moving("rotation", 4, {0, 1, 2, 3}, {0, 0, 0, 1, 0, 0, half, half, 0, 0, 1, 0, 0, 0, half, -half});
  const BuiltScene built = moving.build(0, 0, 3);
  const Instance& instance = built.scene.top_tree.instance(1);
  ASSERT_TRUE(instance.moves());
  EXPECT_GT(instance.key_count, 33u);
  for (int i = 0; i <= 300; ++i) {
    const double angle = 1.5 * 3.14159265358979 * i / 300;
    const Vec3 corner = instance_at(instance, static_cast<float>(i) / 300).object_to_world.point({1, 0, 0});
    EXPECT_NEAR(corner.x, std::cos(angle), 2e-3) << i;
    EXPECT_NEAR(corner.y, std::sin(angle), 2e-3) << i;
  }
}

TEST(MotionKeys, ChildrenAndCamerasGoWithTheirParents) {
  MovingScene moving("translation", 3, {0, 1}, {0, 0, 0, 0, 2, 0});
  WrittenScene& scene = moving.scene;
  scene.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.6}, {"znear", 0.1}}}}};
  scene.json["nodes"].push_back({{"mesh", 1}, {"camera", 0}, {"translation", {0, 0, 7}}});
  scene.json["nodes"][0]["children"] = {2};
  scene.add_node({{"camera", 0}});
  const BuiltScene built = moving.build(0, 0, 1);
  size_t moving_count = 0;
  for (const Instance& instance : built.scene.top_tree.instances()) {
    if (!instance.moves()) continue;
    ++moving_count;
    EXPECT_NEAR(instance_at(instance, 0.5f).object_to_world.translation.y, 1, 1e-6f);
  }
  EXPECT_EQ(moving_count, 2u);
  EXPECT_TRUE(built.report.warnings.empty());
  ASSERT_EQ(built.scene.cameras.size(), 2u);
  const CameraRecord& camera = built.scene.cameras[0];
  EXPECT_NEAR(camera.camera_to_world.translation.y, 1, 1e-6f);
  ASSERT_EQ(camera.key_count, 17u);
  EXPECT_EQ(built.scene.camera_keys[camera.first_key].translation, Vec3(0, 0, 7));
  EXPECT_EQ(built.scene.camera_keys[camera.first_key + 16].translation, Vec3(0, 2, 7));
  EXPECT_EQ(built.scene.cameras[1].key_count, 0u);
}

TEST(MotionKeys, WhatCannotBeBlurredIsNamedAndStandsAsInTheMiddle) {
  MovingScene moving("translation", 3, {0, 1}, {0, 0, 0, 0, 2, 0});
  WrittenScene& scene = moving.scene;
  nlohmann::json& json = scene.json;
  json["extensionsUsed"] = {"KHR_lights_punctual", "EXT_mesh_gpu_instancing"};
  json["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}}};
  json["nodes"].push_back({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  const uint32_t places = scene.add_floats(3, {0, 0, 1, 0, 0, 2});
  json["nodes"].push_back(
      {{"mesh", 1}, {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", places}}}}}}}});
  const nlohmann::json bent = {{"POSITION", scene.add_floats(3, {0, 0, 0, 1, 0, 0, 0, 1, 0})},
                               {"JOINTS_0", scene.add_bytes(4, std::vector<uint8_t>(12), false)},
                               {"WEIGHTS_0", scene.add_floats(4, {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0})}};
  const uint32_t skinned = scene.add_mesh({{"attributes", bent}});
  json["skins"] = {{{"joints", {0}}}, {{"joints", {1}}}};
  json["nodes"].push_back({{"mesh", skinned}, {"skin", 0}});  // below a node that moves, too
  json["nodes"][0]["children"] = {2, 3, 4};
  scene.add_node({{"mesh", skinned}, {"skin", 1}});  // whose joint stands still
  const uint32_t lift = scene.add_floats(3, {0, 0, 3, 0, 0, 3, 0, 0, 3});
  const uint32_t morphed = scene.add_mesh({{"attributes", {{"POSITION", bent["POSITION"]}}},
                                           {"targets", {{{"POSITION", lift}}}}});
  scene.add_node({{"mesh", morphed}});
  const uint32_t input = scene.add_floats(1, {0, 1}), output = scene.add_floats(1, {0, 1});
  nlohmann::json& animation = json["animations"][0];
  animation["channels"].push_back({{"sampler", 1}, {"target", {{"node", 6}, {"path", "weights"}}}});
  animation["samplers"].push_back({{"input", input}, {"output", output}});
  const BuiltScene built = moving.build(0, 0, 1);
  EXPECT_THAT(built.report.warnings,
              ::testing::UnorderedElementsAre(
                  "nodes[2]: its light is not blurred: it stands as in the middle of the shutter",
                  "nodes[3]: its instances are not blurred: they stand as in the middle of the shutter",
                  "nodes[4]: its skin is not blurred: it stands as in the middle of the shutter",
                  "nodes[6]: its morph targets are not blurred: they stand as in the middle of the shutter"));
  EXPECT_EQ(built.scene.lights[0].position[1], 1.0f);
  size_t moving_count = 0;
  for (const Instance& instance : built.scene.top_tree.instances()) moving_count += instance.moves();
  EXPECT_EQ(moving_count, 1u);
  size_t bent_count = 0, lifted_count = 0;
  for (const ReadTriangle& t : built.objects[0]) {
    bent_count += t.position[0] == 0 && t.position[1] == 1 && t.position[2] == 0;
    lifted_count += t.position[2] == 1.5f;
  }
  EXPECT_EQ(bent_count, 1u) << "the skin, as its joint is in the middle";
  EXPECT_EQ(lifted_count, 1u) << "half a target";
}

constexpr double kPi = 3.14159265358979;

/// So many turns about z while the shutter is open, off the origin, flattened and carried along.
std::vector<AffineDouble> turning_keys(int count, double turns) {
  std::vector<AffineDouble> keys(static_cast<size_t>(count));
  for (int k = 0; k < count; ++k) {
    const double part = static_cast<double>(k) / (count - 1), c = std::cos(2 * kPi * turns * part),
                 s = std::sin(2 * kPi * turns * part);
    keys[static_cast<size_t>(k)] = {{{c, s, 0}, {-3 * s, 3 * c, 0}, {0, 0, 0.1}}, {7 + part, -2, 0.5}};
  }
  return keys;
}

double largest_row_sum(const Affine3& m, const Affine3& back) { return absolute_row_sum(widened(m), widened(back)); }

TEST(MotionKeys, BoundsAndErrorsHoldAFastTurnAtEveryTime) {
  Bounds3 object;
  object.include(Vec3(-1, 2, 0)), object.include(Vec3(4, 3, 50));
  for (const auto& [count, turns] : {std::pair{17, 0.5}, {17, 1.9}, {3, 0.24}, {513, 8.0}, {17, 8.0}}) {
    const auto placed = place_moving_instance(0, object, turning_keys(count, turns));
    ASSERT_TRUE(placed);
    std::vector<Instance> rows{placed->instance};
    rows[0].motion_rows = 1, rows[0].key_count = static_cast<uint32_t>(count);
    rows.insert(rows.end(), placed->keys.begin(), placed->keys.end());
    for (int i = 0; i <= 3000; ++i) {
      const Instance now = instance_at(rows[0], static_cast<float>(i) / 3000);
      ASSERT_LE(largest_row_sum(now.object_to_world, now.world_to_object), now.transform_error * (1 + 1e-6)) << i;
      for (int corner = 0; corner < 8; ++corner) {
        const Vec3 p((corner & 1) != 0 ? object.lo.x : object.hi.x, (corner & 2) != 0 ? object.lo.y : object.hi.y,
                     (corner & 4) != 0 ? object.lo.z : object.hi.z);
        const Vec3 at = now.object_to_world.point(p);
        for (int axis = 0; axis < 3; ++axis) {
          ASSERT_GE(at[axis], placed->bounds.lo[axis]) << i;
          ASSERT_LE(at[axis], placed->bounds.hi[axis]) << i;
        }
        ASSERT_LT(glm::length(now.world_to_object.point(at) - p), 1e-3f) << i;
      }
    }
  }
}

TEST(MotionKeys, BetweenKeysAnEighthOfATurnApartItJumps) {
  Bounds3 object;
  object.include(Vec3(0)), object.include(Vec3(1));
  const auto jumps = [&](int count, double turns) {
    const auto placed = place_moving_instance(0, object, turning_keys(count, turns));
    return placed && std::all_of(placed->keys.begin(), placed->keys.end() - 1, stays);
  };
  EXPECT_FALSE(jumps(17, 0.5));
  EXPECT_TRUE(jumps(17, 8));  // halves of a turn: straight ways would lead through the axis
}

TEST(MotionKeys, EmittersThatMoveAreSampledWhereTheyAreAtThatTime) {
  MovingScene moving("scale", 3, {0, 4}, {1, 1, 1, 3, 3, 3});
  moving.scene.add_node({{"mesh", moving.scene.add_triangle_mesh(9, 1)}});
  moving.scene.json["materials"] = {{{"emissiveFactor", {1, 1, 1}}}};
  for (auto& mesh : moving.scene.json["meshes"]) mesh["primitives"][0]["material"] = 0;
  const BuiltScene built = moving.build(1, 0, 2);  // it grows from 1.5 to 2.5
  ASSERT_GT(built.scene.emitters.size(), LightSampler::kFewLights);
  const Material& material = built.scene.materials[built.scene.emitters[0].material];
  const LightReceiver receiver{{2, 0.5f, 3}, 0};
  const Environment none;
  for (const LightChoice choice : {LightChoice::kTree, LightChoice::kPower, LightChoice::kUniform}) {
    const LightSampler lights(built.scene, none, 1, choice);
    EXPECT_EQ(lights.has_tree(), choice == LightChoice::kTree);
    for (const float time : {0.0f, 0.3f, 0.5f, 1.0f}) {
      const double size = 1.5 + time;
      double chance = 0;
      for (const Emitter& e : built.scene.emitters) {
        const bool moves = built.scene.top_tree.instance(e.instance).moves();
        const double pdf = lights.emitter_pdf(material, {e.instance, e.primitive, 0, 0}, receiver, time);
        EXPECT_GT(pdf, 0);
        chance += pdf * (moves ? 0.5 * size * size : 0.5);
      }
      EXPECT_NEAR(chance, 1, 1e-5) << static_cast<int>(choice) << " " << time;
      size_t moved = 0;
      double farthest = 0;
      for (int i = 0; i < 1000; ++i) {
        const LightSample sample =
            lights.sample(receiver.position, receiver, {(i + 0.5) / 1000, i % 31 / 31.0, i % 37 / 37.0}, time);
        ASSERT_GT(sample.pdf, 0);
        const Hit hit{sample.emitter->instance, sample.emitter->primitive, 0, 0};
        const DVec3 way = DVec3(sample.target.point) - DVec3(receiver.position);
        const double cosine = std::abs(glm::dot(way, DVec3(0, 0, 1))) / glm::length(way);
        EXPECT_NEAR(lights.emitter_pdf(material, hit, receiver, time) * glm::dot(way, way) / cosine, sample.pdf,
                    1e-5 * sample.pdf);
        if (!sample.instance->moves()) continue;
        ++moved;
        farthest = std::max<double>(farthest, sample.target.point.x + sample.target.point.y);
      }
      EXPECT_GT(moved, 300u);
      EXPECT_LT(farthest, size * (1 + 1e-6));
      EXPECT_GT(farthest, size * 0.95);
    }
  }
}

TEST(MotionKeys, AMeshThatVanishesOnItsWayStandsAsInTheMiddle) {
  const MovingScene moving("scale", 3, {0, 1, 2}, {1, 1, 1, 0, 0, 0, 1, 1, 1});
  const BuiltScene built = moving.build(0, 0, 1);
  EXPECT_FALSE(built.scene.top_tree.moves());
  ASSERT_EQ(built.report.warnings.size(), 1u);
  EXPECT_THAT(built.report.warnings[0], HasSubstr("it vanishes on its way"));
}

}  // namespace
}  // namespace shoal::testing
