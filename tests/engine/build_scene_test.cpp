#include "engine/build_scene.h"

#include <cstring>
#include <filesystem>

#include "engine/object_ids.h"
#include "tests/engine/built_scene.h"

namespace shoal::testing {
namespace {

using Json = nlohmann::json;

constexpr int kNormal = 0, kTangent = 3, kColor = 7, kUv = 11;  // in FullCorner

/// A grid of n x n quads in z = 0, 2 n^2 triangles.
uint32_t add_grid(WrittenScene& scene, uint32_t n) {
  std::vector<float> positions;
  std::vector<uint32_t> indices;
  for (uint32_t y = 0; y <= n; ++y) {
    for (uint32_t x = 0; x <= n; ++x) {
      positions.insert(positions.end(), {float(x), float(y), float((x * 7 + y * 13) % 5) * 0.1f});
    }
  }
  for (uint32_t y = 0; y < n; ++y) {
    for (uint32_t x = 0; x < n; ++x) {
      const uint32_t a = y * (n + 1) + x, b = a + 1, c = a + n + 1, d = c + 1;
      indices.insert(indices.end(), {a, b, d, a, d, c});
    }
  }
  return scene.add_mesh(
      {{"attributes", {{"POSITION", scene.add_floats(3, positions)}}}, {"indices", scene.add_indices(indices)}});
}

TEST(BuildScene, BakesTheTransformOfAMeshThatOneNodeShows) {
  MemoryFileSystem fs;
  WrittenScene scene;
  scene.add_node({{"mesh", scene.add_triangle_mesh(0, 1)}, {"translation", {10, 20, 30}}, {"scale", {2, 3, 4}}});
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  ASSERT_EQ(built.scene.top_tree.instance_count(), 1u);
  EXPECT_EQ(built.scene.top_tree.instance(0).identity, 1u);
  ASSERT_EQ(built.objects[0].size(), 1u);
  const float expected[9] = {10, 20, 30, 12, 20, 30, 10, 23, 30};
  for (int i = 0; i < 9; ++i) EXPECT_EQ(built.objects[0][0].position[i], expected[i]);
}

TEST(BuildScene, ComposesNodeMatricesFromTheRootDown) {
  MemoryFileSystem fs;
  WrittenScene scene;
  scene.json["nodes"] = {{{"mesh", scene.add_triangle_mesh(1, 1)}, {"translation", {1, 0, 0}}}};
  scene.add_node({{"children", {0}}, {"scale", {-2, 1, 1}}});  // mirrors what its child has moved
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  const float expected[9] = {-4, 0, 0, -4, 1, 0, -6, 0, 0};  // the mirror turns the order, not the front
  for (int i = 0; i < 9; ++i) EXPECT_EQ(built.objects[0][0].position[i], expected[i]);
}

TEST(BuildScene, MovesNormalsByTheInverseTransposeAndTurnsHandednessWithAMirror) {
  MemoryFileSystem fs;
  WrittenScene scene;
  const uint32_t normal_map = scene.add_texture(fs, 1, 1, {128, 128, 255, 255});
  scene.json["materials"] = {{{"normalTexture", {{"index", normal_map}}}}};
  const float s = 0.70710678f;
  const Json attributes = {{"POSITION", scene.add_floats(3, {0, 0, 0, 1, -1, 0, 0, 0, 1})},
                           {"NORMAL", scene.add_floats(3, {s, s, 0, s, s, 0, 2 * s, 2 * s, 0})},
                           {"TANGENT", scene.add_floats(4, {s, -s, 0, 1, s, -s, 0, 1, s, -s, 0, 1})},
                           {"TEXCOORD_0", scene.add_floats(2, {0, 0, 1, 0, 0, 1})}};
  scene.add_node({{"mesh", scene.add_mesh({{"attributes", attributes}, {"material", 0}})}, {"scale", {-1, 3, 1}}});
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  const float root10 = std::sqrt(10.0f);
  for (const FullCorner& corner : built.objects[0][0].corner) {
    const float normal[3] = {-3 / root10, 1 / root10, 0}, tangent[4] = {-1 / root10, -3 / root10, 0, -1};
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(corner[kNormal + i], normal[i], 1e-6) << i;
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(corner[kTangent + i], tangent[i], 1e-6) << i;
  }
}

TEST(BuildScene, RenumbersTheTextureCoordinateSetsOfAMaterial) {
  MemoryFileSystem fs;
  WrittenScene scene;
  const uint32_t a = scene.add_texture(fs, 2, 2, std::vector<uint8_t>(16, 200));
  const uint32_t b = scene.add_texture(fs, 2, 2, std::vector<uint8_t>(16, 100));
  scene.json["materials"] = {{{"pbrMetallicRoughness",
                               {{"baseColorTexture", {{"index", a}, {"texCoord", 3}}},
                                {"metallicRoughnessTexture", {{"index", b}, {"texCoord", 1}}}}},
                              {"normalTexture", {{"index", b}, {"texCoord", 3}}}}};
  const Json attributes = {{"POSITION", scene.add_floats(3, {0, 0, 0, 1, 0, 0, 0, 1, 0})},
                           {"TEXCOORD_0", scene.add_floats(2, {9, 9, 9, 9, 9, 9})},
                           {"TEXCOORD_1", scene.add_floats(2, {1, 2, 3, 4, 5, 6})},
                           {"TEXCOORD_3", scene.add_bytes(2, {0, 255, 51, 0, 0, 102, 0, 0}, true)}};
  scene.json["accessors"][attributes["TEXCOORD_3"].get<size_t>()]["count"] = 3;
  scene.add_node({{"mesh", scene.add_mesh({{"attributes", attributes}, {"material", 0}})}});
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  const Material& material = built.scene.materials[0];
  EXPECT_EQ(material.base_color_texture.uv_set, 0u);
  EXPECT_EQ(material.metallic_roughness_texture.uv_set, 1u);
  EXPECT_EQ(material.normal_texture.uv_set, 0u);
  const ReadTriangle& t = built.objects[0][0];
  EXPECT_EQ(t.corner[0][kUv + 1], 1.0f);
  EXPECT_FLOAT_EQ(t.corner[1][kUv], 0.2f);
  EXPECT_FLOAT_EQ(t.corner[2][kUv + 1], 0.4f);
  EXPECT_EQ(t.corner[2][kUv + 2], 5.0f);
  EXPECT_EQ(t.corner[2][kUv + 3], 6.0f);
}

TEST(BuildScene, RefusesMoreTextureCoordinateSetsThanItStores) {
  MemoryFileSystem fs;
  WrittenScene scene;
  const uint32_t t = scene.add_texture(fs, 1, 1, {255, 255, 255, 255});
  const auto slot = [&](int set) { return Json{{"index", t}, {"texCoord", set}}; };
  scene.json["materials"] = {
      {{"name", "crowded"},
       {"pbrMetallicRoughness", {{"baseColorTexture", slot(0)}, {"metallicRoughnessTexture", slot(1)}}},
       {"normalTexture", slot(2)},
       {"emissiveTexture", slot(3)},
       {"emissiveFactor", {1, 1, 1}},
       {"extensions", {{"KHR_materials_specular", {{"specularTexture", slot(4)}}}}}}};
  scene.json["extensionsUsed"] = {"KHR_materials_specular"};
  const uint32_t mesh = scene.add_triangle_mesh(0, 1);
  scene.json["meshes"][mesh]["primitives"][0]["material"] = 0;
  scene.add_node({{"mesh", mesh}});
  scene.save(fs);
  EXPECT_NE(build_error(fs, ErrorCode::kInput).find("crowded"), std::string::npos);
}

TEST(BuildScene, ReadsVertexColoursWithAndWithoutAlpha) {
  MemoryFileSystem fs;
  WrittenScene scene;
  const uint32_t positions = scene.add_floats(3, {0, 0, 0, 1, 0, 0, 0, 1, 0});
  const uint32_t rgb = scene.add_floats(3, {0.25f, 0.5f, 0.75f, 1, 1, 1, 0, 0, 0});
  const uint32_t rgba = scene.add_bytes(4, {255, 0, 51, 102, 0, 0, 0, 0, 255, 255, 255, 255}, true);
  scene.add_node({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", positions}, {"COLOR_0", rgb}}}})}});
  scene.add_node({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", positions}, {"COLOR_0", rgba}}}})},
                  {"translation", {5, 0, 0}}});
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  ASSERT_EQ(built.objects[0].size(), 2u);
  const FullCorner& first = built.objects[0][0].corner[0];
  const float expected[4] = {0.25f, 0.5f, 0.75f, 1};
  for (int i = 0; i < 4; ++i) EXPECT_EQ(first[kColor + i], expected[i]);
  EXPECT_FLOAT_EQ(built.objects[0][1].corner[0][kColor + 3], 0.4f);
}

TEST(BuildScene, CountsDegenerateTrianglesOfAStripInTheIds) {
  MemoryFileSystem fs;
  WrittenScene scene;
  // 0 1 2 3 3 4 5: triangles 012, 213, 233 (degenerate), 334 (degenerate), 345
  const uint32_t positions = scene.add_floats(3, {0, 0, 0, 0, 1, 0, 1, 0, 0, 1, 1, 0, 2, 0, 0, 2, 1, 0});
  const uint32_t indices = scene.add_indices({0, 1, 2, 3, 3, 4, 5});
  scene.add_node(
      {{"mesh", scene.add_mesh({{"attributes", {{"POSITION", positions}}}, {"indices", indices}, {"mode", 5}})}});
  scene.add_node({{"mesh", scene.add_triangle_mesh(9, 1)}});
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  EXPECT_EQ(built.report.degenerate_count, 2u);
  EXPECT_EQ(built.scene.header.degenerate_count, 2u);
  ASSERT_EQ(built.objects[0].size(), 4u);
  const uint32_t ids[4] = {0, 1, 4, 5};
  for (int i = 0; i < 4; ++i) EXPECT_EQ(built.objects[0][i].primitive, ids[i]);
}

TEST(BuildScene, AWorldOfDegenerateTrianglesIsNoObject) {
  MemoryFileSystem fs;
  WrittenScene scene;
  scene.add_node({{"mesh", scene.add_triangle_mesh(0, 0)}});  // corners that are one point
  scene.add_node({{"mesh", scene.add_triangle_mesh(1, 0)}});
  const uint32_t shared = scene.add_triangle_mesh(2, 1);
  for (const float y : {0.0f, 5.0f}) scene.add_node({{"mesh", shared}, {"translation", {0, y, 0}}});
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  EXPECT_EQ(built.report.degenerate_count, 2u);
  EXPECT_EQ(built.report.triangles_count, 1u);
  EXPECT_EQ(built.report.instanced_triangles_count, 2u);
  EXPECT_EQ(built.report.objects_count, 1u);
  EXPECT_EQ(built.report.instances_count, 2u);
  EXPECT_EQ(built.scene.top_tree.instance(0).object, 0u);
  EXPECT_EQ(built.objects[0].size(), 1u);
  auto ids = ObjectIds::read(*built.scene.file);
  ASSERT_TRUE(ids.ok());
  Hit hit;
  for (hit.instance = 0; hit.instance < 2; ++hit.instance) {
    hit.primitive = built.objects[0][0].primitive;
    EXPECT_EQ(ids.value().of(hit), hit.instance + 1);
  }
}

TEST(BuildScene, CarriesNothingThatTheMaterialsDoNotCallFor) {
  MemoryFileSystem fs;
  WrittenScene scene;
  const Json attributes = {{"POSITION", scene.add_floats(3, {0, 0, 0, 1, 0, 0, 0, 1, 0})},
                           {"TANGENT", scene.add_floats(4, {1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1})},
                           {"TEXCOORD_0", scene.add_floats(2, {0, 0, 1, 0, 0, 1})}};
  scene.add_node({{"mesh", scene.add_mesh({{"attributes", attributes}})}});
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  EXPECT_EQ(built.scene.treelets[0].attributes, kNoPage);
  EXPECT_EQ(built.scene.header.attribute_bytes, 0u);
  ASSERT_EQ(built.scene.materials.size(), 1u);  // the default material
  EXPECT_EQ(built.scene.materials[0].metallic, 1.0f);
}

TEST(BuildScene, WritesTheSameBytesWithAnyNumberOfThreads) {
  MemoryFileSystem fs;
  WrittenScene scene;
  const uint32_t shared = add_grid(scene, 40);
  scene.add_node({{"mesh", add_grid(scene, 60)}});
  scene.add_node({{"mesh", shared}, {"translation", {0, 0, 5}}});
  scene.add_node({{"mesh", shared}, {"translation", {0, 0, 9}}, {"rotation", {0.1, 0.2, 0.3, 0.9273618495495703}}});
  scene.save(fs);
  SceneBuildOptions options;
  options.treelet_bytes = kMinTreeletBytes;
  options.threads = 1;
  build_and_open(fs, options, "scene.gltf", "one.shoal");
  options.threads = 2;
  const BuiltScene built = build_and_open(fs, options, "scene.gltf", "two.shoal");
  EXPECT_GT(built.report.treelets_count, 20u);
  EXPECT_EQ(fs.contents("one.shoal"), fs.contents("two.shoal"));
}

TEST(BuildScene, LeavesNothingBehindWhenItFails) {
  MemoryFileSystem fs;
  WrittenScene scene;
  scene.add_texture(fs, 1, 1, {1, 2, 3, 4});
  fs.put("image0.png", std::string("not a picture"));
  scene.json["materials"] = {{{"name", "wall"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  const uint32_t mesh = scene.add_triangle_mesh(0, 1);
  scene.json["meshes"][mesh]["primitives"][0]["material"] = 0;
  scene.add_node({{"mesh", mesh}});
  scene.save(fs);
  const auto before = fs.names();
  const std::string message = build_error(fs, ErrorCode::kInput);
  EXPECT_NE(message.find("image0.png"), std::string::npos) << message;
  EXPECT_NE(message.find("wall"), std::string::npos) << message;
  EXPECT_EQ(fs.names(), before);
}

TEST(BuildScene, RefusesASceneThatTheMemoryCapCannotHold) {
  MemoryFileSystem fs;
  WrittenScene scene;
  scene.add_node({{"mesh", add_grid(scene, 10)}});
  scene.save(fs);
  SceneBuildOptions options;
  options.max_memory_bytes = 1 << 20;
  EXPECT_NE(build_error(fs, ErrorCode::kMemoryCap, options).find("MiB at least"), std::string::npos);
}

TEST(BuildScene, RefusesASceneWithoutTriangles) {
  MemoryFileSystem fs;
  WrittenScene scene;
  scene.add_node({{"name", "empty"}});
  scene.save(fs);
  EXPECT_NE(build_error(fs, ErrorCode::kInput).find("found none"), std::string::npos);
}

TEST(BuildScene, KeyChangesWithTheSourceAndTheOptions) {
  MemoryFileSystem fs;
  WrittenScene scene;
  scene.add_node({{"mesh", scene.add_triangle_mesh(0, 1)}});
  scene.save(fs);
  const auto key = [&](uint32_t treelet_bytes) {
    SceneBuildOptions options;
    options.treelet_bytes = treelet_bytes;
    auto result = build_cache_key(fs, "scene.gltf", options);
    EXPECT_TRUE(result.ok());
    return result.ok() ? result.value() : 0;
  };
  const uint64_t first = key(1 << 18);
  EXPECT_EQ(first, key(1 << 18));
  EXPECT_NE(first, key(1 << 19));
  std::string longer(100, '\0');
  fs.put("scene.bin", longer);
  EXPECT_NE(first, key(1 << 18));
}

TEST(BuildScene, BuildsEveryRealScene) {
  const char* data = std::getenv("SHOAL_DATA");
  if (data == nullptr) GTEST_SKIP() << "SHOAL_DATA is not set";
  const auto folder = std::filesystem::temp_directory_path() / "shoal_build_scene_test";
  std::filesystem::create_directories(folder);
  int count = 0;
  for (const auto& file : std::filesystem::recursive_directory_iterator(std::string(data) + "/scenes")) {
    if (file.path().extension() != ".gltf" && file.path().extension() != ".glb") continue;
    SCOPED_TRACE(file.path().string());
    const BuiltScene built =
        build_and_open(posix_file_system(), {}, file.path().string(), (folder / "scene.shoal").string());
    uint64_t triangles = 0;
    for (const auto& object : built.objects) triangles += object.size();
    if (!built.objects.empty()) {
      EXPECT_EQ(triangles, built.scene.header.triangles_count);
    }
    ++count;
  }
  std::filesystem::remove_all(folder);
  EXPECT_GT(count, 20);
}

}  // namespace
}  // namespace shoal::testing
