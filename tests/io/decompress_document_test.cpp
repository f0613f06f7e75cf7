#include "io/decompress_document.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "tests/io/gltf_scene.h"
#include "tests/support/packed_meshes.h"

namespace shoal::gltf {
namespace {

using nlohmann::json;
using shoal::testing::DracoSource;
using shoal::testing::pack_draco;
using shoal::testing::pack_sequence;
using shoal::testing::pack_triangles;
using shoal::testing::pack_vertices;
using shoal::testing::PackedDraco;
using ::testing::AnyOf;
using ::testing::HasSubstr;

constexpr uint32_t kGrid = 40;  // quads a side

std::vector<float> grid_positions() {
  std::vector<float> values;
  for (uint32_t y = 0; y <= kGrid; ++y) {
    for (uint32_t x = 0; x <= kGrid; ++x) {
      values.insert(values.end(), {float(x) * 0.25f, float(y) * 0.5f, float((x * 7 + y * 13) % 5)});
    }
  }
  return values;
}

std::vector<uint32_t> grid_indices() {
  std::vector<uint32_t> indices;
  for (uint32_t y = 0; y < kGrid; ++y) {
    for (uint32_t x = 0; x < kGrid; ++x) {
      const uint32_t a = y * (kGrid + 1) + x, b = a + 1, c = a + kGrid + 1, d = c + 1;
      indices.insert(indices.end(), {a, b, d, a, d, c});
    }
  }
  return indices;
}

/// A view whose bytes are compressed; its parent lies in a buffer that is not there.
uint32_t add_meshopt_view(GltfScene& scene, const std::string& packed, uint64_t count, uint32_t stride, const char* mode,
                          const char* filter = "NONE") {
  const uint32_t raw = scene.add_view_bytes(std::as_bytes(std::span(packed)), 0);
  json view = scene.root["bufferViews"][raw];
  view["buffer"] = 0;
  view["byteStride"] = stride;
  view["count"] = count;
  view["mode"] = mode;
  view["filter"] = filter;
  json& parent = scene.root["bufferViews"][raw];
  parent = {{"buffer", 1}, {"byteOffset", 0}, {"byteLength", count * stride}};
  if (std::string(mode) == "ATTRIBUTES") parent["byteStride"] = stride;
  parent["extensions"]["EXT_meshopt_compression"] = view;
  return raw;
}

/// Call when all bytes are there.
void add_buffers(GltfScene& scene) {
  scene.root["buffers"] = {{{"uri", "scene.bin"}, {"byteLength", scene.binary.size()}},
                           {{"byteLength", 1 << 20}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
}

GltfScene meshopt_grid() {
  GltfScene scene;
  const std::vector<float> positions = grid_positions();
  const std::vector<uint32_t> indices = grid_indices();
  const size_t vertices = positions.size() / 3;
  const uint32_t p = add_meshopt_view(scene, pack_vertices(positions.data(), vertices, 12), vertices, 12, "ATTRIBUTES");
  const uint32_t i = add_meshopt_view(scene, pack_triangles(indices, vertices), indices.size(), 4, "TRIANGLES");
  scene.add_accessor({{"bufferView", p}, {"type", "VEC3"}, {"componentType", kFloat}, {"count", vertices}});
  scene.add_accessor(
      {{"bufferView", i}, {"type", "SCALAR"}, {"componentType", kUnsignedInt}, {"count", indices.size()}});
  scene.add_mesh({{"attributes", {{"POSITION", 0}}}, {"indices", 1}});
  add_buffers(scene);
  scene.root["extensionsRequired"] = {"EXT_meshopt_compression"};
  return scene;
}

DracoSource grid_source() {
  DracoSource source;
  source.positions = grid_positions();
  source.indices = grid_indices();
  for (size_t i = 0; i < source.positions.size() / 3; ++i) {
    source.normals.insert(source.normals.end(), {0, 0, 1});
    source.uvs.insert(source.uvs.end(), {float(i % 7) / 8, float(i % 5) / 4});
  }
  return source;
}

GltfScene draco_scene(const PackedDraco& packed) {
  GltfScene scene;
  const uint32_t view = scene.add_view_bytes(std::as_bytes(std::span(packed.bytes)), 0);
  const size_t vertices = packed.positions.size() / 3;
  scene.add_accessor({{"type", "VEC3"}, {"componentType", kFloat}, {"count", vertices}});
  scene.add_accessor({{"type", "VEC3"}, {"componentType", kFloat}, {"count", vertices}});
  scene.add_accessor({{"type", "VEC2"}, {"componentType", kFloat}, {"count", vertices}});
  scene.add_accessor({{"type", "SCALAR"}, {"componentType", kUnsignedShort}, {"count", packed.indices.size()}});
  const json ids = {{"POSITION", packed.position_id}, {"NORMAL", packed.normal_id}, {"TEXCOORD_0", packed.uv_id}};
  scene.add_mesh({{"attributes", {{"POSITION", 0}, {"NORMAL", 1}, {"TEXCOORD_0", 2}}},
                  {"indices", 3},
                  {"extensions", {{"KHR_draco_mesh_compression", {{"bufferView", view}, {"attributes", ids}}}}}});
  scene.root["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  return scene;
}

struct Loaded {
  MemoryFileSystem fs;
  Document document;
  Status status;
  explicit Loaded(const GltfScene& scene) {
    auto result = load_document(fs, scene.put(fs));
    if (!result.ok()) {
      status = result.error();
      return;
    }
    document = std::move(result).value();
    status = decompress(fs, "dir", nullptr, document);
  }
  std::vector<float> floats(uint32_t accessor) { return read_all(fs, document, accessor); }
  std::vector<float> attribute(const char* name) {
    return floats(document.meshes[0].primitives[0].attributes.at(name));
  }
};

std::string error_of(const GltfScene& scene) {
  const Loaded loaded(scene);
  if (loaded.status.ok()) return "";
  EXPECT_EQ(loaded.status.error().code, ErrorCode::kInput);
  return loaded.status.error().message;
}

TEST(Decompress, GivesTheVerticesAndTrianglesThatMeshoptimizerPacked) {
  Loaded loaded(meshopt_grid());
  ASSERT_TRUE(loaded.status.ok()) << loaded.status.error().message;
  EXPECT_EQ(loaded.floats(0), grid_positions());
  // The codec may turn a triangle's corners round; the set of triangles in order is the same.
  const std::vector<uint32_t> found = read_triangles(loaded.fs, loaded.document), expected = grid_indices();
  ASSERT_EQ(found.size(), expected.size());
  for (size_t t = 0; t < expected.size(); t += 3) {
    const auto at = std::find(&expected[t], &expected[t] + 3, found[t]) - &expected[t];
    for (long k = 0; k < 3; ++k) EXPECT_EQ(found[t + static_cast<size_t>(k)], expected[t + static_cast<size_t>((at + k) % 3)]);
  }
}

TEST(Decompress, ReadsIndexSequencesOfBothSizes) {
  const std::vector<uint32_t> indices = {5, 1, 2, 65000, 7, 7, 0};
  for (const uint32_t stride : {2u, 4u}) {
    GltfScene scene;
    scene.add_accessor<float>(std::vector<float>(3 * 65001), "VEC3", kFloat, 65001);
    const uint32_t view = add_meshopt_view(scene, pack_sequence(indices, 65001), indices.size(), stride, "INDICES");
    scene.add_accessor({{"bufferView", view},
                        {"type", "SCALAR"},
                        {"componentType", stride == 2 ? kUnsignedShort : kUnsignedInt},
                        {"count", indices.size()}});
    scene.add_mesh({{"attributes", {{"POSITION", 0}}}, {"indices", 1}, {"mode", 6}});
    add_buffers(scene);
    Loaded loaded(scene);
    ASSERT_TRUE(loaded.status.ok()) << loaded.status.error().message;
    EXPECT_EQ(loaded.floats(1), std::vector<float>(indices.begin(), indices.end()));
  }
}

TEST(Decompress, UndoesTheFiltersOfAttributes) {
  GltfScene scene;
  // Octahedral of 8 bits: x, y in -127..127, z holds one, w is left alone.
  const std::vector<int8_t> oct = {0, 0, 127, 9, 127, 0, 127, 8, 0, -127, 127, 7, -64, 63, 127, 6};
  // Exponential: 24 bits of mantissa, 8 of exponent: 3 * 2^-1, -1 * 2^4, 0, 5 * 2^0.
  const std::vector<uint32_t> exponential = {0xff000003u, 0x04ffffffu, 0u, 5u};
  // Quaternion: three components of 1 / sqrt 2 at most, and which one is left out: here w is the largest, all others 0.
  const std::vector<int16_t> quaternion = {0, 0, 0, 0x7ff3 | 3};
  const uint32_t a = add_meshopt_view(scene, pack_vertices(oct.data(), 4, 4), 4, 4, "ATTRIBUTES", "OCTAHEDRAL");
  const uint32_t b = add_meshopt_view(scene, pack_vertices(exponential.data(), 4, 4), 4, 4, "ATTRIBUTES", "EXPONENTIAL");
  const uint32_t c = add_meshopt_view(scene, pack_vertices(quaternion.data(), 1, 8), 1, 8, "ATTRIBUTES", "QUATERNION");
  scene.add_accessor<float>(std::vector<float>(12), "VEC3", kFloat, 4);
  scene.add_accessor({{"bufferView", a}, {"type", "VEC4"}, {"componentType", kByte}, {"count", 4}});
  scene.add_accessor({{"bufferView", b}, {"type", "SCALAR"}, {"componentType", kFloat}, {"count", 4}});
  scene.add_accessor({{"bufferView", c}, {"type", "VEC4"}, {"componentType", kShort}, {"count", 1}});
  scene.add_mesh({{"attributes", {{"POSITION", 0}, {"_A", 1}, {"_B", 2}}}});
  scene.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"ROTATION", 3}};
  add_buffers(scene);
  Loaded loaded(scene);
  ASSERT_TRUE(loaded.status.ok()) << loaded.status.error().message;
  const std::vector<float> normals = loaded.floats(1);
  const float expected[4][3] = {{0, 0, 127}, {127, 0, 0}, {0, -127, 0}, {-90, 89, 0}};
  for (size_t i = 0; i < 4; ++i) {
    for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(normals[4 * i + k], expected[i][k], 1.01f) << i << " " << k;
    EXPECT_EQ(normals[4 * i + 3], 9 - float(i));
  }
  EXPECT_EQ(loaded.floats(2), (std::vector<float>{1.5f, -16, 0, 5}));
  EXPECT_EQ(loaded.floats(3), (std::vector<float>{0, 0, 0, 32767}));
}

TEST(Decompress, GivesWhatDracoGives) {
  for (const bool sequential : {false, true}) {
    for (const int bits : {0, 12}) {
      DracoSource source = grid_source();
      source.sequential = sequential;
      source.quantization_bits = bits;
      const PackedDraco packed = pack_draco(source);
      Loaded loaded(draco_scene(packed));
      ASSERT_TRUE(loaded.status.ok()) << loaded.status.error().message;
      EXPECT_EQ(loaded.attribute("POSITION"), packed.positions);
      EXPECT_EQ(loaded.attribute("NORMAL"), packed.normals);
      EXPECT_EQ(loaded.attribute("TEXCOORD_0"), packed.uvs);
      EXPECT_EQ(read_triangles(loaded.fs, loaded.document), packed.indices);
      EXPECT_EQ(packed.indices.size(), source.indices.size());
    }
  }
}

TEST(Decompress, DecodesADracoMeshOnceForPrimitivesThatShareIt) {
  GltfScene scene = draco_scene(pack_draco(grid_source()));
  const uint64_t once = compression_needs(Loaded(scene).document).scratch_bytes;  // nothing is left to do
  EXPECT_EQ(once, 0u);
  MemoryFileSystem fs;
  const uint64_t one = compression_needs(load_document(fs, scene.put(fs)).value()).scratch_bytes;
  scene.root["meshes"][0]["primitives"].push_back(scene.root["meshes"][0]["primitives"][0]);
  EXPECT_EQ(compression_needs(load_document(fs, scene.put(fs)).value()).scratch_bytes, one);
  Loaded loaded(scene);
  const auto& primitives = loaded.document.meshes[0].primitives;
  EXPECT_EQ(primitives[0].indices, primitives[1].indices);
  EXPECT_EQ(primitives[0].attributes, primitives[1].attributes);
}

TEST(Decompress, LeavesAloneWhatTheSceneDoesNotShow) {
  GltfScene scene = meshopt_grid();
  scene.root["nodes"].push_back({{"name", "empty"}});
  scene.root["scenes"] = {{{"nodes", {1}}}};
  Loaded loaded(scene);
  ASSERT_TRUE(loaded.status.ok());
  EXPECT_TRUE(loaded.document.views[0].meshopt);
  MemoryFileSystem fs;
  EXPECT_EQ(compression_needs(load_document(fs, scene.put(fs)).value()).memory_bytes, 0u);
}

TEST(Decompress, ADracoPrimitiveWhoseAccessorsHaveBytesIsReadFromThem) {
  const PackedDraco packed = pack_draco(grid_source());
  GltfScene scene = draco_scene(packed);
  scene.root["accessors"][0]["bufferView"] = scene.add_view(packed.positions);
  scene.root["accessors"][1]["bufferView"] = scene.add_view(packed.normals);
  scene.root["accessors"][2]["bufferView"] = scene.add_view(packed.uvs);
  scene.root["accessors"][3]["bufferView"] =
      scene.add_view(std::vector<uint16_t>(packed.indices.begin(), packed.indices.end()));
  MemoryFileSystem fs;
  const Document document = load_document(fs, scene.put(fs)).value();
  EXPECT_EQ(compression_needs(document).memory_bytes, 0u);
  EXPECT_EQ(read_triangles(fs, document), packed.indices);
}

TEST(Decompress, RefusesViewsThatCannotBeWhatTheySay) {
  const auto broken = [](const char* key, const json& value) {
    GltfScene scene = meshopt_grid();
    scene.root["bufferViews"][0]["extensions"]["EXT_meshopt_compression"][key] = value;
    return error_of(scene);
  };
  EXPECT_THAT(broken("count", 7), HasSubstr("bufferViews[0].extensions.EXT_meshopt_compression.count"));
  EXPECT_THAT(broken("count", 1ull << 52), HasSubstr("count"));
  EXPECT_THAT(broken("byteStride", 10), HasSubstr("byteStride"));
  EXPECT_THAT(broken("byteStride", 0), HasSubstr("byteStride"));
  EXPECT_THAT(broken("byteLength", 1ull << 40), HasSubstr("byteLength"));
  EXPECT_THAT(broken("byteLength", 4), HasSubstr("compressed"));
  EXPECT_THAT(broken("buffer", 1), HasSubstr("fallback"));
  EXPECT_THAT(broken("buffer", 2), HasSubstr("buffer"));
  EXPECT_THAT(broken("mode", "SECRET"), HasSubstr("mode"));
  EXPECT_THAT(broken("filter", "OCTAHEDRAL"), HasSubstr("byteStride"));
  GltfScene plain = meshopt_grid();
  plain.root["bufferViews"][0].erase("extensions");
  EXPECT_THAT(error_of(plain), HasSubstr("fallback"));
}

TEST(Decompress, RefusesBytesOfAnotherCodecAndThoseCutShort) {
  GltfScene scene = meshopt_grid();
  json& packed = scene.root["bufferViews"][0]["extensions"]["EXT_meshopt_compression"];
  packed["byteLength"] = packed["byteLength"].get<uint64_t>() - 5;
  EXPECT_THAT(error_of(scene), HasSubstr("compressed by meshoptimizer"));
  GltfScene other = meshopt_grid();
  other.binary[0] = std::byte{0x31};
  EXPECT_THAT(error_of(other), HasSubstr("another codec"));
}

TEST(Decompress, RefusesDracoMeshesOfOtherSizesThanTheDocumentSays) {
  const PackedDraco packed = pack_draco(grid_source());
  const auto with_count = [&](size_t accessor, uint64_t count) {
    GltfScene scene = draco_scene(packed);
    scene.root["accessors"][accessor]["count"] = count;
    return error_of(scene);
  };
  const uint64_t vertices = packed.positions.size() / 3, corners = packed.indices.size();
  EXPECT_THAT(with_count(3, corners - 3), HasSubstr("triangles"));
  EXPECT_THAT(with_count(3, corners - 1), HasSubstr("multiple of 3"));
  EXPECT_THAT(with_count(1, vertices + 1), HasSubstr("NORMAL"));
  GltfScene fewer = draco_scene(packed);
  for (size_t i = 0; i < 3; ++i) fewer.root["accessors"][i]["count"] = vertices - 1;
  EXPECT_THAT(error_of(fewer), HasSubstr("vertices"));
  GltfScene wide = draco_scene(packed);
  wide.root["accessors"][2]["type"] = "VEC3";
  wide.root["meshes"][0]["primitives"][0]["attributes"] = {{"POSITION", 0}, {"NORMAL", 2}, {"_N", 1}};
  wide.root["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"] = {
      {"POSITION", packed.position_id}, {"NORMAL", packed.uv_id}, {"_N", packed.normal_id}};
  EXPECT_THAT(error_of(wide), HasSubstr("components"));
  GltfScene nameless = draco_scene(packed);
  nameless.root["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"]["NORMAL"] = 77;
  EXPECT_THAT(error_of(nameless), HasSubstr("attribute 77"));
}

/// The bytes of the values are cut off: what is refused for its attributes never came to decode them.
TEST(Decompress, RefusesDracoAttributesBeyondTheDocumentBeforeTheyAreDecoded) {
  for (const bool sequential : {false, true}) {
    for (const std::vector<uint32_t>& hidden : {std::vector<uint32_t>{100}, std::vector<uint32_t>(40, 1)}) {
      DracoSource source = grid_source();
      source.sequential = sequential;
      source.hidden_components = hidden;
      PackedDraco packed = pack_draco(source);
      GltfScene whole = draco_scene(packed);
      EXPECT_THAT(error_of(whole), HasSubstr("bytes a vertex in all, found")) << sequential << hidden.size();
      packed.bytes.resize(packed.bytes.size() * 3 / 4);
      EXPECT_THAT(error_of(draco_scene(packed)),
                  AnyOf(HasSubstr(fmt::format("found {} attributes", 3 + hidden.size())), HasSubstr("found seams of 42")));
    }
  }
  // One of a component beside the document's fits into what is planned for these.
  DracoSource source = grid_source();
  source.hidden_components = {1};
  EXPECT_EQ(error_of(draco_scene(pack_draco(source))), "");
}

TEST(Decompress, RefusesDracoBytesCutShortOrOfSomethingElse) {
  PackedDraco packed = pack_draco(grid_source());
  for (const size_t left : {size_t{1}, size_t{11}, size_t{40}, packed.bytes.size() / 2, packed.bytes.size() - 1}) {
    PackedDraco cut = packed;
    cut.bytes.resize(left);
    EXPECT_THAT(error_of(draco_scene(cut)), HasSubstr("expected a Draco mesh")) << left;
  }
  packed.bytes[1] = 'Q';
  EXPECT_THAT(error_of(draco_scene(packed)), HasSubstr("another format"));
}

/// What fails is fine, what crashes is not.
TEST(Decompress, SurvivesBytesThatWereChanged) {
  std::mt19937 random(11);
  const GltfScene whole[2] = {meshopt_grid(), draco_scene(pack_draco(grid_source()))};
  for (int round = 0; round < 400; ++round) {
    GltfScene scene = whole[round % 2];
    for (uint32_t changes = 1 + random() % 4; changes > 0; --changes) {
      scene.binary[random() % (round % 4 < 2 ? scene.binary.size() : 64)] = static_cast<std::byte>(random());
    }
    Loaded loaded(scene);
    if (loaded.status.ok()) read_everything(loaded.fs, loaded.document);
  }
}

}  // namespace
}  // namespace shoal::gltf
