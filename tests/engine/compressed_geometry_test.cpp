// Scenes whose geometry is quantised, compressed or instanced build to what their plain twins build to.
#include <gmock/gmock.h>

#include <cstring>

#include "tests/engine/built_scene.h"
#include "tests/support/packed_meshes.h"

namespace shoal::testing {
namespace {

using Json = nlohmann::json;
using ::testing::HasSubstr;

constexpr uint32_t kSide = 60;  // quads

struct Grid {
  std::vector<float> positions, normals, uvs;
  std::vector<uint32_t> indices;
};

Grid grid() {
  Grid g;
  for (uint32_t y = 0; y <= kSide; ++y) {
    for (uint32_t x = 0; x <= kSide; ++x) {
      g.positions.insert(g.positions.end(), {float(x), float(y), float((x * 7 + y * 13) % 5)});
      g.normals.insert(g.normals.end(), {0, 0, 1});
      g.uvs.insert(g.uvs.end(), {float(x) / 64, float(y) / 64});
    }
  }
  for (uint32_t y = 0; y < kSide; ++y) {
    for (uint32_t x = 0; x < kSide; ++x) {
      const uint32_t a = y * (kSide + 1) + x, b = a + 1, c = a + kSide + 1, d = c + 1;
      g.indices.insert(g.indices.end(), {a, b, d, a, d, c});
    }
  }
  return g;
}

/// A scene of its own file, with compressed bytes behind the plain ones.
struct PackedScene {
  Json json = {{"asset", {{"version", "2.0"}}}, {"scene", 0}, {"scenes", {{{"nodes", {0}}}}}, {"nodes", {{{"mesh", 0}}}}};
  std::string binary;

  uint32_t add_view(const std::string& bytes) {
    binary.resize((binary.size() + 3) / 4 * 4);
    json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", bytes.size()}});
    binary += bytes;
    return static_cast<uint32_t>(json["bufferViews"].size() - 1);
  }
  uint32_t add_packed_view(const std::string& bytes, size_t count, size_t stride, const char* mode) {
    const uint32_t view = add_view(bytes);
    Json packed = json["bufferViews"][view];
    packed.update({{"count", count}, {"byteStride", stride}, {"mode", mode}});
    json["bufferViews"][view] = {{"buffer", 1}, {"byteLength", count * stride}};
    if (std::string(mode) == "ATTRIBUTES") json["bufferViews"][view]["byteStride"] = stride;
    json["bufferViews"][view]["extensions"]["EXT_meshopt_compression"] = packed;
    return view;
  }
  uint32_t add_accessor(const Json& view, const char* type, int component, size_t count) {
    Json accessor = {{"type", type}, {"componentType", component}, {"count", count}};
    if (!view.is_null()) accessor["bufferView"] = view;
    json["accessors"].push_back(accessor);
    return static_cast<uint32_t>(json["accessors"].size() - 1);
  }
  void save(MemoryFileSystem& fs) {
    json["buffers"] = {{{"uri", "scene.bin"}, {"byteLength", binary.size()}},
                       {{"byteLength", 1 << 26}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
    fs.put("scene.bin", binary);
    fs.put("scene.gltf", json.dump());
  }
};

void save_plain(MemoryFileSystem& fs, const Grid& g) {
  WrittenScene scene;
  const Json attributes = {{"POSITION", scene.add_floats(3, g.positions)}, {"NORMAL", scene.add_floats(3, g.normals)}};
  scene.add_node({{"mesh", scene.add_mesh({{"attributes", attributes}, {"indices", scene.add_indices(g.indices)}})}});
  scene.save(fs);
}

void save_meshopt(MemoryFileSystem& fs, const Grid& g) {
  PackedScene scene;
  const size_t n = g.positions.size() / 3;
  const uint32_t p = scene.add_packed_view(pack_vertices(g.positions.data(), n, 12), n, 12, "ATTRIBUTES");
  const uint32_t normal = scene.add_packed_view(pack_vertices(g.normals.data(), n, 12), n, 12, "ATTRIBUTES");
  const uint32_t i = scene.add_packed_view(pack_sequence(g.indices, n), g.indices.size(), 4, "INDICES");
  scene.add_accessor(p, "VEC3", 5126, n);
  scene.add_accessor(normal, "VEC3", 5126, n);
  scene.add_accessor(i, "SCALAR", 5125, g.indices.size());
  scene.json["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", 0}, {"NORMAL", 1}}}, {"indices", 2}}}}}};
  scene.save(fs);
}

void save_draco(MemoryFileSystem& fs, const PackedDraco& packed) {
  PackedScene scene;
  const size_t n = packed.positions.size() / 3;
  const uint32_t view = scene.add_view(packed.bytes);
  scene.add_accessor(nullptr, "VEC3", 5126, n);
  scene.add_accessor(nullptr, "VEC3", 5126, n);
  scene.add_accessor(nullptr, "SCALAR", 5125, packed.indices.size());
  Json primitive = {{"attributes", {{"POSITION", 0}, {"NORMAL", 1}}}, {"indices", 2}};
  primitive["extensions"]["KHR_draco_mesh_compression"] = {
      {"bufferView", view}, {"attributes", {{"POSITION", packed.position_id}, {"NORMAL", packed.normal_id}}}};
  scene.json["meshes"] = {{{"primitives", {primitive}}}};
  scene.save(fs);
}

void expect_same_triangles(const BuiltScene& a, const BuiltScene& b) {
  ASSERT_EQ(a.objects.size(), b.objects.size());
  for (size_t o = 0; o < a.objects.size(); ++o) {
    ASSERT_EQ(a.objects[o].size(), b.objects[o].size());
    for (size_t t = 0; t < a.objects[o].size(); ++t) {
      const ReadTriangle &x = a.objects[o][t], &y = b.objects[o][t];
      ASSERT_EQ(x.primitive, y.primitive);
      ASSERT_EQ(std::memcmp(&x.position, &y.position, sizeof x.position), 0) << t;
      ASSERT_EQ(std::memcmp(&x.corner, &y.corner, sizeof x.corner), 0) << t;
    }
  }
}

/// At once, and in chunks of 500 triangles.
void expect_same_builds(MemoryFileSystem& a, MemoryFileSystem& b) {
  for (const uint64_t chunk : {uint64_t{0}, uint64_t{500}}) {
    SceneBuildOptions options;
    options.chunk_triangles = chunk;
    const BuiltScene built_a = build_and_open(a, options), built_b = build_and_open(b, options);
    EXPECT_EQ(built_a.report.chunks_count > 0, chunk > 0);
    EXPECT_EQ(built_b.report.chunks_count, built_a.report.chunks_count);
    expect_same_triangles(built_a, built_b);
  }
}

TEST(CompressedGeometry, AMeshoptSceneBuildsAsItsPlainTwin) {
  MemoryFileSystem plain, packed;
  save_plain(plain, grid());
  save_meshopt(packed, grid());
  expect_same_builds(plain, packed);
}

TEST(CompressedGeometry, ADracoSceneBuildsAsItsPlainTwin) {
  const Grid g = grid();
  const PackedDraco draco = pack_draco({g.positions, g.normals, {}, g.indices, false, 11});
  MemoryFileSystem plain, packed;
  save_plain(plain, {draco.positions, draco.normals, {}, draco.indices});
  save_draco(packed, draco);
  expect_same_builds(plain, packed);
}

TEST(CompressedGeometry, AnInstancedPackedMeshIsDecodedOnceForAllItsPlaces) {
  const Grid g = grid();
  const PackedDraco draco = pack_draco({g.positions, g.normals, {}, g.indices, false, 0});
  MemoryFileSystem fs;
  save_draco(fs, draco);
  const std::vector<std::byte> text = fs.contents("scene.gltf");
  Json json = Json::parse(std::string(reinterpret_cast<const char*>(text.data()), text.size()));
  json["nodes"].push_back({{"mesh", 0}, {"translation", {100, 0, 0}}});
  json["scenes"][0]["nodes"] = {0, 1};
  fs.put("scene.gltf", json.dump());
  const BuiltScene built = build_and_open(fs);
  EXPECT_EQ(built.report.instances_count, 2u);
  EXPECT_EQ(built.report.triangles_count, g.indices.size() / 3);
}

TEST(CompressedGeometry, AnImageThatIsNotThereIsRefusedBeforeAnythingIsDecoded) {
  MemoryFileSystem fs;
  save_meshopt(fs, grid());
  const std::vector<std::byte> text = fs.contents("scene.gltf");
  Json json = Json::parse(std::string(reinterpret_cast<const char*>(text.data()), text.size()));
  json["images"] = {{{"uri", "wall.png"}}};
  json["textures"] = {{{"source", 0}}};
  json["materials"] = {{{"name", "wall"}, {"emissiveFactor", {1, 1, 1}}, {"emissiveTexture", {{"index", 0}}}}};
  json["meshes"][0]["primitives"][0]["material"] = 0;
  fs.put("scene.gltf", json.dump());
  std::string stages;
  SceneBuildOptions options;
  options.progress = [&](const BuildProgress& progress) { stages += std::string(progress.stage) + " "; };
  const std::string huge("\x89PNG\r\n\x1a\n\0\0\0\rIHDR\x7f\0\0\0\x7f\0\0\0\x08\x06\0\0\0", 29);
  for (const std::string& bytes : {std::string(), std::string("not a picture"), huge, huge.substr(0, 20)}) {
    if (!bytes.empty()) fs.put("wall.png", bytes);
    stages.clear();
    const std::string message = build_error(fs, ErrorCode::kInput, options);
    EXPECT_THAT(message, HasSubstr("images[0] (wall.png), used by"));
    EXPECT_EQ(stages, "reading reading ");
  }
  fs.put("wall.png", png_bytes(1, 1, {255, 255, 255, 255}));
  EXPECT_EQ(build_and_open(fs, options).report.triangles_count, grid().indices.size() / 3);
  EXPECT_THAT(stages, HasSubstr("decompressing"));
}

TEST(CompressedGeometry, ACapTooSmallForAMeshNamesTheOneThatWorks) {
  Grid g = grid();
  // Many vertices in one compressed view, of which few are drawn: decoding is what takes most.
  g.positions.resize(3 * 4000000);
  g.normals.clear();
  MemoryFileSystem fs;
  PackedScene scene;
  const size_t n = g.positions.size() / 3;
  const uint32_t p = scene.add_packed_view(pack_vertices(g.positions.data(), n, 12), n, 12, "ATTRIBUTES");
  scene.add_accessor(p, "VEC3", 5126, n);
  scene.add_accessor(scene.add_packed_view(pack_sequence(g.indices, n), g.indices.size(), 4, "INDICES"), "SCALAR", 5125,
                     g.indices.size());
  scene.json["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", 0}}}, {"indices", 1}}}}}};
  scene.save(fs);
  SceneBuildOptions options;
  options.threads = 1;
  options.max_memory_bytes = 50ull << 20;
  const std::string message = build_error(fs, ErrorCode::kMemoryCap, options);
  EXPECT_THAT(message, HasSubstr("the memory cap is 50 MiB"));
  const size_t at = message.find("building needs ");
  ASSERT_NE(at, std::string::npos) << message;
  const uint64_t least = std::stoull(message.substr(at + 15));
  EXPECT_GE(least, 16 + 48 * 1000000 / (1 << 20));
  EXPECT_LT(least, 90u);
  options.max_memory_bytes = least << 20;
  EXPECT_EQ(build_and_open(fs, options).report.triangles_count, g.indices.size() / 3);
  options.max_memory_bytes = (least - 1) << 20;
  build_error(fs, ErrorCode::kMemoryCap, options);
}

TEST(QuantizedGeometry, IntegersOfEverySizeAreScaledAsTheExtensionSays) {
  // The same triangle as floats, as 16-bit integers under a scaled node, and as normalised bytes under another.
  MemoryFileSystem fs;
  WrittenScene scene;
  const auto add = [&](const std::vector<int>& values, int component, const char* type, uint32_t width, uint32_t stride,
                       bool normalized) {
    std::vector<uint8_t> bytes;
    const uint32_t size = component == 5120 || component == 5121 ? 1 : 2;
    for (size_t i = 0; i < values.size(); ++i) {
      for (uint32_t b = 0; b < size; ++b) bytes.push_back(static_cast<uint8_t>(values[i] >> 8 * b));
      if ((i + 1) % width == 0) bytes.resize((bytes.size() + stride - 1) / stride * stride);
    }
    const uint32_t accessor = scene.add_bytes(1, bytes, normalized);
    Json& out = scene.json["accessors"][accessor];
    out["componentType"] = component, out["type"] = type, out["count"] = values.size() / width;
    scene.json["bufferViews"][out["bufferView"].get<size_t>()]["byteStride"] = stride;
    return accessor;
  };
  scene.json["extensionsRequired"] = {"KHR_mesh_quantization"};
  const uint32_t shorts = add({0, 0, 0, 200, 0, 0, 0, -300, 100}, 5122, "VEC3", 3, 8, false);
  const uint32_t normal = add({0, 0, 127, 0, 0, 127, 0, 127, 0}, 5120, "VEC3", 3, 4, true);
  scene.add_node({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", shorts}, {"NORMAL", normal}}}})},
                  {"scale", {0.01, 0.01, 0.01}}});
  const uint32_t scaled = add({0, 0, 0, 255, 0, 0, 0, 255, 51}, 5121, "VEC3", 3, 4, true);
  scene.add_node({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", scaled}}}})}, {"translation", {10, 0, 0}}});
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  ASSERT_EQ(built.objects[0].size(), 2u);
  const float first[9] = {0, 0, 0, 2, 0, 0, 0, -3, 1}, second[9] = {10, 0, 0, 11, 0, 0, 10, 1, 0.2f};
  for (int i = 0; i < 9; ++i) {
    EXPECT_FLOAT_EQ(built.objects[0][0].position[i], first[i]);
    EXPECT_FLOAT_EQ(built.objects[0][1].position[i], second[i]);
  }
  EXPECT_EQ(built.objects[0][0].corner[2][1], 1.0f);
}

TEST(GpuInstancing, PlacesEachInstanceBelowItsNode) {
  MemoryFileSystem fs;
  WrittenScene scene;
  const float h = 0.70710678f;
  const uint32_t t = scene.add_floats(3, {1, 0, 0, 0, 5, 0, 0, 0, 7});
  const uint32_t r = scene.add_floats(4, {0, 0, 0, 1, 0, 0, h, h, 0, 0, 0, 2});
  const uint32_t s = scene.add_floats(3, {1, 1, 1, 2, 2, 2, 1, -1, 1});
  Json node = {{"mesh", scene.add_triangle_mesh(0, 1)}, {"translation", {10, 0, 0}}, {"scale", {3, 3, 3}}};
  node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"TRANSLATION", t}, {"ROTATION", r}, {"SCALE", s}};
  scene.add_node(node);
  scene.json["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  ASSERT_EQ(built.report.instances_count, 3u);
  EXPECT_EQ(built.report.triangles_count, 1u);
  EXPECT_EQ(built.report.instanced_triangles_count, 3u);
  // The corner (1, 0, 0) of the mesh: T R S, then the node's scale and translation.
  const Vec3 expected[3] = {{16, 0, 0}, {10, 21, 0}, {13, 0, 21}};
  for (uint32_t i = 0; i < 3; ++i) {
    const Vec3 p = built.scene.top_tree.instance(i).object_to_world.point({1, 0, 0});
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(p[c], expected[i][c], 1e-5) << i;
  }
}

TEST(GpuInstancing, OneInstanceIsBakedAndThoseWithoutAPlaceAreLeftOut) {
  MemoryFileSystem fs;
  WrittenScene scene;
  const uint32_t t = scene.add_floats(3, {1, 2, 3, std::nanf(""), 0, 0, 4, 5, 6});
  const uint32_t r = scene.add_floats(4, {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0});
  Json node = {{"mesh", scene.add_triangle_mesh(0, 1)}};
  node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"TRANSLATION", t}, {"ROTATION", r}};
  scene.add_node(node);
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  EXPECT_EQ(built.report.instances_count, 1u);
  EXPECT_EQ(built.scene.top_tree.instance(0).identity, 1u);
  EXPECT_EQ(built.objects[0][0].position[0], 1.0f);
  ASSERT_EQ(built.report.warnings.size(), 1u);
  EXPECT_THAT(built.report.warnings[0], HasSubstr("2 instances of nodes[0] are left out"));
}

TEST(GpuInstancing, ReadsPlacesThatAreCompressed) {
  const std::vector<float> places = {1, 0, 0, 0, 2, 0, 0, 0, 3, 4, 0, 0};
  MemoryFileSystem fs;
  PackedScene scene;
  const float corners[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  scene.add_accessor(scene.add_view({reinterpret_cast<const char*>(corners), sizeof corners}), "VEC3", 5126, 3);
  scene.add_accessor(scene.add_packed_view(pack_vertices(places.data(), 4, 12), 4, 12, "ATTRIBUTES"), "VEC3", 5126, 4);
  scene.json["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", 0}}}}}}}};
  scene.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"TRANSLATION", 1}};
  scene.save(fs);
  const BuiltScene built = build_and_open(fs);
  ASSERT_EQ(built.report.instances_count, 4u);
  EXPECT_EQ(built.scene.top_tree.instance(2).object_to_world.translation.z, 3.0f);
}

TEST(CompressedGeometry, SkinsAndPlacesThatTheSceneDoesNotShowAreNotDecoded) {
  const auto saved = [](MemoryFileSystem& fs, bool shown, bool skinned) {
    PackedScene scene;
    const float corners[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    scene.add_accessor(scene.add_view({reinterpret_cast<const char*>(corners), sizeof corners}), "VEC3", 5126, 3);
    const std::string junk(100, '\7');
    scene.add_accessor(scene.add_packed_view(junk, 1, 64, "ATTRIBUTES"), "MAT4", 5126, 1);
    scene.add_accessor(scene.add_packed_view(junk, 1, 12, "ATTRIBUTES"), "VEC3", 5126, 1);
    scene.json["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", 0}}}}}}}};
    scene.json["skins"] = {{{"joints", {0}}, {"inverseBindMatrices", 1}}};
    Json node = {{"mesh", 0}};
    if (skinned) node["skin"] = 0;
    if (!skinned) node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"TRANSLATION", 2}};
    scene.json["nodes"].push_back(node);
    if (shown) scene.json["scenes"][0]["nodes"].push_back(1);
    scene.save(fs);
  };
  for (const bool skinned : {true, false}) {
    MemoryFileSystem fs;
    saved(fs, false, skinned);
    EXPECT_EQ(build_and_open(fs).report.triangles_count, 1u);
    saved(fs, true, skinned);
    EXPECT_THAT(build_error(fs, ErrorCode::kInput), HasSubstr("EXT_meshopt_compression"));
  }
}

TEST(GpuInstancing, MoreInstancesThanMemoryAreRefusedBeforeTheyAreListed) {
  MemoryFileSystem fs;
  WrittenScene scene;
  Json node = {{"mesh", scene.add_triangle_mesh(0, 1)}};
  scene.json["accessors"].push_back({{"type", "VEC3"}, {"componentType", 5126}, {"count", 10000000}});
  node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"TRANSLATION", 1}};
  scene.add_node(node);
  scene.save(fs);
  SceneBuildOptions options;
  options.max_memory_bytes = 256u << 20;
  EXPECT_THAT(build_error(fs, ErrorCode::kMemoryCap, options), HasSubstr("for its 10000000 instances"));
  options.limits.instances_count = 1000;
  options.max_memory_bytes = 1ull << 40;
  EXPECT_THAT(build_error(fs, ErrorCode::kInput, options), HasSubstr("expected at most 1000"));
}

}  // namespace
}  // namespace shoal::testing
