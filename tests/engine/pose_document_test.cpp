// Nodes, morph targets and skins at a time: against values worked out by hand.
#include "engine/pose_document.h"

#include <gmock/gmock.h>

#include <cmath>
#include <cstring>

#include "engine/animation_sample.h"
#include "tests/engine/built_scene.h"

namespace shoal::testing {
namespace {

using Json = nlohmann::json;
using ::testing::HasSubstr;

constexpr float kHalf = 0.70710678f;

SceneBuildOptions at_time(double time, const std::string& animation = "") {
  SceneBuildOptions options;
  options.pose.time = time;
  options.pose.animation = animation;
  return options;
}

/// A triangle at node 0 and an animation of one channel.
struct MovingTriangle {
  WrittenScene scene;
  MovingTriangle(const char* path, uint32_t width, const std::vector<float>& times, const std::vector<float>& values,
                 const char* interpolation) {
    scene.add_node({{"mesh", scene.add_triangle_mesh(0, 1)}});
    const uint32_t input = scene.add_floats(1, times), output = scene.add_floats(width, values);
    scene.json["animations"] = {
        {{"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", path}}}}}},
         {"samplers", {{{"input", input}, {"output", output}, {"interpolation", interpolation}}}}}};
  }
  BuiltScene build(double time) const {
    MemoryFileSystem fs;
    scene.save(fs);
    return build_and_open(fs, at_time(time));
  }
  std::string error(ErrorCode code, double time = 0.5) const {
    MemoryFileSystem fs;
    scene.save(fs);
    return build_error(fs, code, at_time(time));
  }
};

void expect_corner(const BuiltScene& built, int corner, const Vec3& expected, double tolerance = 1e-6) {
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(built.objects[0][0].position[3 * corner + c], expected[c], tolerance) << "corner " << corner << " " << c;
  }
}

TEST(Animation, StepsHoldTheirValue) {
  const MovingTriangle moving("translation", 3, {1, 2, 4}, {1, 0, 0, 2, 0, 0, 4, 0, 0}, "STEP");
  const double expected[][2] = {{-3, 1}, {1, 1}, {1.99, 1}, {2, 2}, {3.9, 2}, {4, 4}, {100, 4}};
  for (const auto& [time, x] : expected) expect_corner(moving.build(time), 0, {x, 0, 0}, 0);
}

TEST(Animation, LinesGoStraightBetweenKeysAndStopAtTheEnds) {
  const MovingTriangle moving("translation", 3, {1, 2, 4}, {1, 0, 0, 2, 8, 0, 4, 0, 0}, "LINEAR");
  expect_corner(moving.build(0), 0, {1, 0, 0}, 0);
  expect_corner(moving.build(1.25), 0, {1.25f, 2, 0}, 0);
  expect_corner(moving.build(3), 0, {3, 4, 0}, 0);
  expect_corner(moving.build(9), 0, {4, 0, 0}, 0);
}

TEST(Animation, SplinesFollowTheirTangents) {
  // Keys: in-tangent, value, out-tangent. From 0 at slope 6 to 2 at slope 0 in 2 seconds.
  const MovingTriangle moving("scale", 3, {0, 2}, {9, 9, 9, 1, 1, 1, 6, 0, 0, 0, 0, 0, 3, 1, 1, 9, 9, 9}, "CUBICSPLINE");
  // Halfway: (v0 + v1) / 2 + length (out0 - in1) / 8 = 2 + 2 * 6 / 8.
  expect_corner(moving.build(1), 1, {3.5f, 0, 0});
  expect_corner(moving.build(2), 1, {3, 0, 0}, 0);
}

TEST(Animation, RotationsTurnEvenlyTheShorterWay) {
  // A quarter about z, written with the other sign: still 30 degrees after a third, not the long way round.
  for (const float sign : {1.0f, -1.0f}) {
    const MovingTriangle moving("rotation", 4, {0, 3}, {0, 0, 0, 1, 0, 0, sign * kHalf, sign * kHalf}, "LINEAR");
    expect_corner(moving.build(1), 1, {std::sqrt(0.75f), 0.5f, 0});
    expect_corner(moving.build(3), 1, {0, 1, 0});
  }
  const MovingTriangle spline("rotation", 4, {0, 1}, {0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0,  //
                                                      0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0}, "CUBICSPLINE");
  expect_corner(spline.build(0.5), 1, {0, 1, 0});  // between none and a half turn: made a unit again
}

TEST(Animation, SlerpMeetsItsEndsAndKeepsItsSpeed) {
  for (const double angle : {1e-5, 0.01, 0.06, 0.5, 1.5, 3.0}) {  // of the rotation
    const std::array<double, 4> a{0, 0, 0, 1}, b{std::sin(angle / 2), 0, 0, std::cos(angle / 2)};
    for (const double s : {0.0, 0.25, 0.5, 1.0}) {
      const std::array<double, 4> q = slerp(a, b, s);
      EXPECT_NEAR(q[0], std::sin(s * angle / 2), 1e-6) << angle << " " << s;
      EXPECT_NEAR(q[3], std::cos(s * angle / 2), 1e-6);
    }
  }
}

TEST(Animation, AnotherThanTheFirstIsChosenByNameOrIndex) {
  MovingTriangle moving("translation", 3, {0}, {1, 0, 0}, "STEP");
  WrittenScene& scene = moving.scene;
  Json other = scene.json["animations"][0];
  other["samplers"][0]["output"] = scene.add_floats(3, {7, 0, 0});
  other["name"] = "other";
  scene.json["animations"].push_back(other);
  MemoryFileSystem fs;
  scene.save(fs);
  expect_corner(build_and_open(fs, {}), 0, {0, 0, 0}, 0);
  expect_corner(build_and_open(fs, at_time(0)), 0, {1, 0, 0}, 0);
  expect_corner(build_and_open(fs, at_time(0, "1")), 0, {7, 0, 0}, 0);
  SceneBuildOptions named;
  named.pose.animation = "other";
  const BuiltScene built = build_and_open(fs, named);
  expect_corner(built, 0, {7, 0, 0}, 0);
  EXPECT_THAT(build_error(fs, ErrorCode::kUsage, at_time(0, "2")), HasSubstr("the scene has 2"));
  EXPECT_THAT(build_error(fs, ErrorCode::kUsage, at_time(std::nan(""))), HasSubstr("finite number of seconds"));

  EXPECT_TRUE(check_pose(built.scene, {}).ok());
  EXPECT_TRUE(check_pose(built.scene, named.pose).ok());
  EXPECT_TRUE(check_pose(built.scene, {0.0, "1"}).ok());
  EXPECT_EQ(check_pose(built.scene, {0.0, ""}).error().code, ErrorCode::kUsage);
  EXPECT_THAT(check_pose(built.scene, {0.5, "other"}).error().message, HasSubstr("at 0 s of animation 1 (other)"));
  const BuiltScene rest = build_and_open(fs, {});
  EXPECT_THAT(check_pose(rest.scene, {0.0, ""}).error().message, HasSubstr("at rest"));
}

TEST(Animation, EachPoseHasAPlaceOfItsOwnInTheCache) {
  const MovingTriangle moving("translation", 3, {0, 1}, {1, 0, 0, 2, 0, 0}, "LINEAR");
  MemoryFileSystem fs;
  moving.scene.save(fs);
  const auto key = [&](const SceneBuildOptions& options) { return build_cache_key(fs, "scene.gltf", options).value(); };
  EXPECT_NE(key({}), key(at_time(0)));
  EXPECT_NE(key(at_time(0)), key(at_time(1)));
  EXPECT_EQ(key(at_time(0.5)), key(at_time(0.5, "0")));
  SceneBuildOptions blurred = at_time(0.5), longer = at_time(0.5);
  blurred.pose.shutter = {0, 0.25}, longer.pose.shutter = {0, 0.5};
  EXPECT_NE(key(at_time(0.5)), key(blurred));
  EXPECT_NE(key(longer), key(blurred));
}

TEST(Animation, ATimeForASceneWithoutAnimationIsRefused) {
  MemoryFileSystem fs;
  WrittenScene scene;
  scene.add_node({{"mesh", scene.add_triangle_mesh(0, 1)}});
  scene.save(fs);
  EXPECT_THAT(build_error(fs, ErrorCode::kUsage, at_time(1)), HasSubstr("the scene has no animation"));
}

TEST(Animation, ABrokenOneRefusesNobodyButWhoAsksForIt) {
  MovingTriangle moving("translation", 3, {0}, {1, 0, 0}, "STEP");
  Json& animations = moving.scene.json["animations"];
  animations.push_back(animations[0]);
  animations[1]["name"] = "broken";
  animations[1]["samplers"][0]["input"] = 999;
  MemoryFileSystem fs;
  moving.scene.save(fs);
  const BuiltScene rest = build_and_open(fs, {});
  ASSERT_EQ(rest.report.warnings.size(), 1u);
  EXPECT_THAT(rest.report.warnings[0], HasSubstr("animations[1] cannot be shown: "));
  expect_corner(build_and_open(fs, at_time(0)), 0, {1, 0, 0}, 0);
  EXPECT_THAT(build_error(fs, ErrorCode::kInput, at_time(0, "broken")), HasSubstr("animations[1].samplers[0].input"));
}

TEST(Animation, DataThatCannotBeMeantIsNamedWithItsPlace) {
  const float nan = std::nanf("");
  const auto error = [](const char* path, uint32_t width, const std::vector<float>& times,
                        const std::vector<float>& values, const char* interpolation) {
    return MovingTriangle(path, width, times, values, interpolation).error(ErrorCode::kInput);
  };
  const std::vector<float> moves = {0, 0, 0, 1, 1, 1};
  EXPECT_THAT(error("translation", 3, {1, 1}, moves, "LINEAR"),
              HasSubstr("animations[0].samplers[0].input: element 1: expected a time after 1, found 1"));
  EXPECT_THAT(error("translation", 3, {nan, 1}, moves, "LINEAR"), HasSubstr("element 0: expected a finite time"));
  EXPECT_THAT(error("translation", 3, {0, 1}, {0, nan, 0, 1, 1, 1}, "LINEAR"),
              HasSubstr("samplers[0].output: element 0: expected finite values"));
  EXPECT_THAT(error("rotation", 4, {0, 1}, {0, 0, 0, 0, 0, 0, 0, 1}, "STEP"), HasSubstr("a rotation of length 1"));
  EXPECT_THAT(error("weights", 1, {0}, std::vector<float>(65537), "STEP"),
              HasSubstr("expected 1 values for each of at most 65536 morph targets, found 65537"));
  EXPECT_THAT(error("rotation", 4, {0, 1}, {0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0,  //
                                            0, 0, 0, 0, 0, 0, 0, -1, 0, 0, 0, 0}, "CUBICSPLINE"),
              HasSubstr("keeps off length 0"));
}

/// Two targets: one moves along z, one widens along x and bends the normals.
struct MorphedTriangle {
  WrittenScene scene;
  uint32_t mesh = 0;
  MorphedTriangle() {
    const Json attributes = {{"POSITION", scene.add_floats(3, {0, 0, 0, 1, 0, 0, 0, 1, 0})},
                             {"NORMAL", scene.add_floats(3, {0, 0, 1, 0, 0, 1, 0, 0, 1})}};
    const Json lift = {{"POSITION", scene.add_floats(3, {0, 0, 1, 0, 0, 2, 0, 0, 3})}};
    const Json bend = {{"POSITION", scene.add_floats(3, {0, 0, 0, 4, 0, 0, 0, 0, 0})},
                       {"NORMAL", scene.add_floats(3, {3, 0, 0, 0, 3, 0, 0, 0, 0})}};
    mesh = scene.add_mesh({{"attributes", attributes}, {"targets", {lift, bend}}});
  }
};

TEST(MorphTargets, MoveVerticesAndNormalsByTheirWeights) {
  MemoryFileSystem fs;
  MorphedTriangle morphed;
  morphed.scene.json["meshes"][0]["weights"] = {0.5, 0.25};
  morphed.scene.add_node({{"mesh", morphed.mesh}, {"translation", {10, 0, 0}}});
  morphed.scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  expect_corner(built, 0, {10, 0, 0.5f}, 0);
  expect_corner(built, 1, {12, 0, 1}, 0);
  expect_corner(built, 2, {10, 1, 1.5f}, 0);
  const ReadTriangle& t = built.objects[0][0];
  EXPECT_NEAR(t.corner[0][0], 0.6, 1e-6);  // (0.75, 0, 1) made a unit
  EXPECT_NEAR(t.corner[0][2], 0.8, 1e-6);
  EXPECT_NEAR(t.corner[1][1], 0.6, 1e-6);
  EXPECT_EQ(t.corner[2][2], 1.0f);
}

TEST(MorphTargets, TheWeightsOfANodeReplaceThoseOfItsMeshAndEachPoseIsAMesh) {
  MemoryFileSystem fs;
  MorphedTriangle morphed;
  morphed.scene.json["meshes"][0]["weights"] = {1, 0};
  morphed.scene.add_node({{"mesh", 0}});
  morphed.scene.add_node({{"mesh", 0}, {"weights", {0, 0}}, {"translation", {0, 5, 0}}});
  morphed.scene.add_node({{"mesh", 0}, {"translation", {0, 9, 0}}});
  morphed.scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  // The first and the third share a mesh and are instances of it; the second is baked into the world.
  ASSERT_EQ(built.objects.size(), 2u);
  EXPECT_EQ(built.report.instances_count, 3u);
  EXPECT_EQ(built.objects[0][0].position[2], 0.0f);
  EXPECT_EQ(built.objects[0][0].position[1], 5.0f);
  EXPECT_EQ(built.objects[1][0].position[2], 1.0f);
}

TEST(MorphTargets, NodesWithTheSameWeightsShareAMesh) {
  MemoryFileSystem fs;
  MorphedTriangle morphed;
  for (int i = 0; i < 6; ++i) {
    Json node = {{"mesh", 0}, {"translation", {0, i, 0}}};
    if (i % 3 != 0) node["weights"] = {i % 3, 0.5 * (i % 3 - 1)};  // none and twice (1, 0) and (2, 0.5)
    morphed.scene.add_node(node);
  }
  morphed.scene.add_node({{"mesh", 0}, {"translation", {0, 6, 0}}, {"weights", {0, 0}}});
  morphed.scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  EXPECT_EQ(built.report.objects_count, 3u);
  EXPECT_EQ(built.report.instances_count, 7u);
  EXPECT_EQ(built.report.triangles_count, 3u);
  EXPECT_EQ(built.objects[0][0].position[2], 0.0f);
  EXPECT_EQ(built.objects[1][0].position[2], 1.0f);
  EXPECT_EQ(built.objects[2][0].position[2], 2.0f);
}

TEST(MorphTargets, WeightsAreAnimated) {
  MemoryFileSystem fs;
  MorphedTriangle morphed;
  WrittenScene& scene = morphed.scene;
  scene.add_node({{"mesh", 0}});
  const uint32_t input = scene.add_floats(1, {0, 2}), output = scene.add_floats(1, {0, 0, 1, 0.5f});
  scene.json["animations"] = {{{"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "weights"}}}}}},
                               {"samplers", {{{"input", input}, {"output", output}}}}}};
  scene.save(fs);
  expect_corner(build_and_open(fs, at_time(0)), 1, {1, 0, 0}, 0);
  expect_corner(build_and_open(fs, at_time(1)), 1, {2, 0, 1}, 0);
  expect_corner(build_and_open(fs, at_time(2)), 1, {3, 0, 2}, 0);
  Json& accessor = scene.json["accessors"][output];
  accessor["count"] = 2;
  scene.save(fs);
  EXPECT_THAT(build_error(fs, ErrorCode::kInput, at_time(1)), HasSubstr("nodes[0]: expected 2 weights"));
}

/// A strip along y whose lower end hangs on joint 0 and whose upper end on joint 1, one unit higher.
struct SkinnedStrip {
  WrittenScene scene;
  SkinnedStrip() {
    const std::vector<float> positions = {0, 0, 0, 1, 0, 0, 0, 2, 0};
    const Json attributes = {{"POSITION", scene.add_floats(3, positions)},
                             {"NORMAL", scene.add_floats(3, {1, 0, 0, 1, 0, 0, 1, 0, 0})},
                             {"JOINTS_0", scene.add_bytes(4, {0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0}, false)},
                             {"WEIGHTS_0", scene.add_floats(4, {1, 0, 0, 0, 0.5f, 0.5f, 0, 0, 1, 0, 0, 0})}};
    scene.add_mesh({{"attributes", attributes}});
    const uint32_t bind = scene.add_floats(4, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1,  //
                                               1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1});
    scene.json["accessors"][bind]["type"] = "MAT4";
    scene.json["accessors"][bind]["count"] = 2;
    scene.json["skins"] = {{{"joints", {1, 2}}, {"inverseBindMatrices", bind}}};
    scene.add_node({{"mesh", 0}, {"skin", 0}, {"translation", {100, 100, 100}}});  // of no account
    scene.json["nodes"].push_back({{"children", {2}}, {"translation", {10, 0, 0}}});
    scene.json["nodes"].push_back({{"translation", {0, 1, 0}}, {"rotation", {0, 0, kHalf, kHalf}}});
    scene.json["scenes"][0]["nodes"].push_back(1);
  }
};

TEST(Skins, MoveVerticesByTheirJointsAlone) {
  MemoryFileSystem fs;
  SkinnedStrip strip;
  strip.scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  ASSERT_EQ(built.objects[0].size(), 1u);
  expect_corner(built, 0, {10, 0, 0});
  // Half of (1, 0, 0) + (10, 0, 0), half of the quarter turn about (0, 1, 0): (1, -1, 0) -> (1, 1, 0) + (10, 1, 0).
  expect_corner(built, 1, {11, 1, 0});
  expect_corner(built, 2, {9, 1, 0});
  const ReadTriangle& t = built.objects[0][0];
  EXPECT_EQ(t.corner[0][0], 1.0f);
  // The mean of the identity and a quarter turn turns by half of it; normals are made units.
  EXPECT_NEAR(t.corner[1][0], kHalf, 1e-6);
  EXPECT_NEAR(t.corner[1][1], kHalf, 1e-6);
  EXPECT_NEAR(t.corner[2][1], 1, 1e-6);
}

TEST(Skins, AMirroredJointKeepsTheFrontAndTheNormal) {
  MemoryFileSystem fs;
  SkinnedStrip strip;
  strip.scene.json["nodes"][1]["scale"] = {1, 1, -1};
  strip.scene.json["nodes"][2].erase("rotation");
  strip.scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  expect_corner(built, 1, {10, 2, 0});  // the second and third corner swap
  expect_corner(built, 2, {11, 0, 0});
  EXPECT_EQ(built.objects[0][0].corner[0][0], 1.0f);
}

TEST(Skins, TwoNodesWithOneMeshAreTwoPoses) {
  MemoryFileSystem fs;
  SkinnedStrip strip;
  strip.scene.json["nodes"].push_back({{"mesh", 0}, {"skin", 1}});
  strip.scene.json["nodes"].push_back({{"translation", {0, 0, 50}}});
  strip.scene.json["scenes"][0]["nodes"] = {0, 1, 3, 4};
  strip.scene.json["skins"].push_back({{"joints", {4, 4}}});
  strip.scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  ASSERT_EQ(built.objects.size(), 1u);
  ASSERT_EQ(built.objects[0].size(), 2u);
  expect_corner(built, 0, {10, 0, 0});
  EXPECT_EQ(built.objects[0][1].position[2], 50.0f);
  EXPECT_EQ(built.objects[0][1].position[7], 2.0f);
}

TEST(Skins, JointsAreAnimatedThroughTheirParents) {
  MemoryFileSystem fs;
  SkinnedStrip strip;
  WrittenScene& scene = strip.scene;
  const uint32_t input = scene.add_floats(1, {0, 1}), output = scene.add_floats(3, {10, 0, 0, 30, 0, 0});
  scene.json["animations"] = {{{"channels", {{{"sampler", 0}, {"target", {{"node", 1}, {"path", "translation"}}}}}},
                               {"samplers", {{{"input", input}, {"output", output}}}}}};
  scene.save(fs);
  const BuiltScene built = build_and_open(fs, at_time(0.5));
  expect_corner(built, 0, {20, 0, 0});
  expect_corner(built, 2, {19, 1, 0});
}

TEST(Skins, AJointThatTheSkinHasNotAndAMatrixThatIsNotFiniteAreRefused) {
  MemoryFileSystem fs;
  SkinnedStrip strip;
  strip.scene.json["skins"][0]["joints"] = {1};
  strip.scene.save(fs);
  EXPECT_THAT(build_error(fs, ErrorCode::kInput), HasSubstr("meshes[0].primitives[0]: JOINTS: expected a joint below 1"));
  SkinnedStrip wild;
  const uint32_t bind = wild.scene.add_floats(4, std::vector<float>(32, std::nanf("")));
  wild.scene.json["accessors"][bind]["type"] = "MAT4";
  wild.scene.json["accessors"][bind]["count"] = 2;
  wild.scene.json["skins"][0]["inverseBindMatrices"] = bind;
  wild.scene.save(fs);
  EXPECT_THAT(build_error(fs, ErrorCode::kInput), HasSubstr("skins[0]: joint 0 (nodes[1]): expected a finite matrix"));
}

/// Many posed triangles: in one piece and in chunks, on one thread and many.
TEST(Skins, APosedMeshIsTheSameHoweverItIsBuilt) {
  MemoryFileSystem fs;
  WrittenScene scene;
  std::vector<float> positions, lift, weights;
  std::vector<uint8_t> joints;
  constexpr int kCount = 20000;
  for (int i = 0; i < 3 * kCount; ++i) {
    const int t = i / 3;
    positions.insert(positions.end(), {float(t % 140) + (i % 3 == 1), float(t / 140) + (i % 3 == 2), 0});
    lift.insert(lift.end(), {0, 0, float(i % 11)});
    joints.insert(joints.end(), {0, 1, 0, 0});
    weights.insert(weights.end(), {float(i % 5), float(4 - i % 5), 0, 0});
  }
  const Json attributes = {{"POSITION", scene.add_floats(3, positions)},
                           {"JOINTS_0", scene.add_bytes(4, joints, false)},
                           {"WEIGHTS_0", scene.add_floats(4, weights)}};
  scene.add_mesh({{"attributes", attributes}, {"targets", {{{"POSITION", scene.add_floats(3, lift)}}}}});
  scene.json["meshes"][0]["weights"] = {0.75};
  scene.add_node({{"mesh", 0}, {"skin", 0}});
  scene.add_node({{"scale", {1, 2, 3}}});
  scene.add_node({{"rotation", {0.1, 0.2, 0.3, 0.9}}});
  scene.json["skins"] = {{{"joints", {1, 2}}}};
  scene.save(fs);
  SceneBuildOptions one, chunks;
  one.threads = 1;
  chunks.chunk_triangles = 3000;
  const BuiltScene a = build_and_open(fs, one), b = build_and_open(fs, chunks);
  ASSERT_EQ(a.objects[0].size(), size_t{kCount});
  ASSERT_EQ(b.objects[0].size(), size_t{kCount});
  for (size_t t = 0; t < size_t{kCount}; ++t) {
    ASSERT_EQ(std::memcmp(&a.objects[0][t].position, &b.objects[0][t].position, sizeof a.objects[0][t].position), 0);
  }
}

}  // namespace
}  // namespace shoal::testing
