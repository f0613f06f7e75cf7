#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/io/gltf_scene.h"

namespace shoal::gltf {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;

Result<Document> load(const GltfScene& scene) {
  MemoryFileSystem fs;
  return load_document(fs, scene.put(fs));
}

std::array<double, 3> transform(const std::array<double, 16>& m, double x, double y, double z) {
  std::array<double, 3> p;
  for (size_t row = 0; row < 3; ++row) p[row] = m[row] * x + m[row + 4] * y + m[row + 8] * z + m[row + 12];
  return p;
}

TEST(GltfNodes, ScaleThenRotateThenTranslate) {
  GltfScene scene;
  const double h = std::sqrt(0.5);  // a quarter turn about z: x goes to y
  scene.root["nodes"] = {{{"translation", {10, 20, 30}}, {"rotation", {0, 0, h, h}}, {"scale", {2, 3, 4}}}};
  const auto document = load(scene);
  ASSERT_TRUE(document.ok()) << document.error().message;
  const auto p = transform(document.value().nodes[0].matrix, 1, 1, 1);
  EXPECT_NEAR(p[0], 10 - 3, 1e-12);
  EXPECT_NEAR(p[1], 20 + 2, 1e-12);
  EXPECT_NEAR(p[2], 30 + 4, 1e-12);
}

TEST(GltfNodes, RotatesAsTheQuaternionProductDoes) {
  GltfScene scene;
  const std::array<double, 4> q{0.1, -0.7, 0.3, 0.6};
  scene.root["nodes"] = {{{"rotation", q}}};
  const auto document = load(scene);
  ASSERT_TRUE(document.ok()) << document.error().message;
  // v' = v + 2 u x (u x v + w v), for the unit quaternion (u, w).
  const double length = std::sqrt(0.01 + 0.49 + 0.09 + 0.36);
  const std::array<double, 3> u{q[0] / length, q[1] / length, q[2] / length}, v{1.5, -2, 0.25};
  const double w = q[3] / length;
  const auto cross = [](const std::array<double, 3>& a, const std::array<double, 3>& b) {
    return std::array<double, 3>{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  };
  auto inner = cross(u, v);
  for (size_t i = 0; i < 3; ++i) inner[i] += w * v[i];
  const auto outer = cross(u, inner);
  const auto p = transform(document.value().nodes[0].matrix, v[0], v[1], v[2]);
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(p[i], v[i] + 2 * outer[i], 1e-12);
}

TEST(GltfNodes, KeepsAMatrixAsItIs) {
  GltfScene scene;
  const std::array<double, 16> matrix{-1, 2, 3, 0, 5, 6, 7, 0, 9, 10, 11, 0, 13, 14, 15, 1};
  scene.root["nodes"] = {{{"matrix", matrix}}};
  EXPECT_EQ(load(scene).value().nodes[0].matrix, matrix);
}

TEST(GltfNodes, ChoosesTheDefaultSceneThenTheFirstThenAllParentlessNodes) {
  GltfScene scene;
  scene.root["nodes"] = {{{"children", {2}}}, json::object(), json::object()};
  EXPECT_THAT(load(scene).value().roots, ElementsAre(0, 1));
  scene.root["scenes"] = {{{"nodes", {1}}}, {{"nodes", {0}}}};
  EXPECT_THAT(load(scene).value().roots, ElementsAre(1));
  scene.root["scene"] = 1;
  EXPECT_THAT(load(scene).value().roots, ElementsAre(0));
}

TEST(GltfNodes, RefusesCyclesSecondParentsAndForeignRoots) {
  GltfScene scene;
  scene.root["nodes"] = {{{"children", {1}}}, {{"children", {0}}}, json::object()};
  EXPECT_THAT(load_error(scene), HasSubstr("nodes: expected nodes without a cycle"));
  scene.root["nodes"] = {{{"children", {0}}}};
  EXPECT_THAT(load_error(scene), HasSubstr("cycle"));
  scene.root["nodes"] = {{{"children", {2}}}, {{"children", {2}}}, json::object()};
  EXPECT_THAT(load_error(scene), HasSubstr("nodes[1].children: expected one parent of nodes[2]"));
  scene.root["nodes"] = {{{"children", {1}}}, json::object()};
  scene.root["scenes"] = {{{"nodes", {1}}}};
  EXPECT_THAT(load_error(scene), HasSubstr("scenes[0].nodes: expected nodes without a parent"));
  scene.root["scenes"] = {{{"nodes", {0, 0}}}};
  EXPECT_THAT(load_error(scene), HasSubstr("each node once"));
}

TEST(GltfNodes, BoundsDepthAndInstances) {
  GltfScene scene = triangle_scene();
  scene.root["scenes"][0]["nodes"] = {0};
  scene.root["nodes"] = json::array();
  for (int i = 0; i < 10; ++i) scene.root["nodes"].push_back({{"mesh", 0}, {"children", {i + 1}}});
  scene.root["nodes"].push_back(json::object());
  Limits limits;
  limits.node_depth = 11;
  limits.instances_count = 10;
  EXPECT_EQ(load_error(scene, limits), "");
  limits.node_depth = 10;
  EXPECT_THAT(load_error(scene, limits), HasSubstr("nodes at most 10 deep"));
  limits = {};
  limits.instances_count = 9;
  EXPECT_THAT(load_error(scene, limits), HasSubstr("at most 9 nodes with meshes, found 10"));
}

TEST(GltfNodes, RefusesMatricesThatAreNotAffineAndEmptyQuaternions) {
  GltfScene scene;
  scene.root["nodes"] = {{{"matrix", {1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}}}};
  EXPECT_THAT(load_error(scene), HasSubstr("nodes[0].matrix: expected an affine matrix"));
  scene.root["nodes"] = {{{"rotation", {0, 0, 0, 0}}}};
  EXPECT_THAT(load_error(scene), HasSubstr("nodes[0].rotation: expected a unit quaternion"));
  scene.root["nodes"] = {{{"scale", {1, 2}}}};
  EXPECT_THAT(load_error(scene), HasSubstr("nodes[0].scale: expected an array of 3 numbers, found an array of 2"));
  scene.root["nodes"] = {{{"scale", {1, 2, 1e39}}}};
  EXPECT_THAT(load_error(scene), HasSubstr("nodes[0].scale[2]: expected a number in the range of float"));
}

}  // namespace
}  // namespace shoal::gltf
