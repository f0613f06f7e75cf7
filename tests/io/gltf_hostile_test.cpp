// Documents that are wrong: each must be refused with an error that names its place, and none may crash the reader.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/uri.h"
#include "tests/io/gltf_scene.h"

namespace shoal::gltf {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::StartsWith;

/// The error of a triangle's scene in which the value at a JSON pointer is replaced.
std::string error_with(const char* pointer, const json& value) {
  GltfScene scene = triangle_scene();
  scene.root["buffers"] = {{{"uri", "scene.bin"}, {"byteLength", scene.binary.size()}}};
  scene.root[json::json_pointer(pointer)] = value;
  return load_error(scene);
}

TEST(HostileGltf, NamesFilePlaceExpectedAndFound) {
  EXPECT_EQ(error_with("/accessors/2/count", -1),
            "dir/scene.gltf: accessors[2].count: expected a whole number >= 0, found -1");
  EXPECT_EQ(
      error_with("/meshes/0/primitives/0/attributes/POSITION", 7),
      "dir/scene.gltf: meshes[0].primitives[0].attributes.POSITION: expected a whole number from 0 to 2, found 7");
  EXPECT_EQ(error_with("/materials/0/alphaMode", "GLASS"),
            "dir/scene.gltf: materials[0].alphaMode: expected OPAQUE, MASK or BLEND, found GLASS");
}

TEST(HostileGltf, RefusesNumbersThatAreNotWholeOrTooLarge) {
  for (const json& bad : {json(-1), json(1.5), json(1e300), json(18446744073709551615u), json("3"), json(nullptr),
                          json(true), json::array({3}), json::object()}) {
    EXPECT_THAT(error_with("/accessors/2/count", bad), HasSubstr("accessors[2].count: expected a whole number"));
    EXPECT_THAT(error_with("/bufferViews/0/byteOffset", bad), HasSubstr("bufferViews[0]"));
    EXPECT_THAT(error_with("/accessors/0/byteOffset", bad), HasSubstr("accessors[0]"));
  }
  EXPECT_EQ(error_with("/accessors/2/count", 3.0), "");  // JSON knows no integers
}

TEST(HostileGltf, RefusesRangesThatLeaveTheirViewOrBuffer) {
  for (const uint64_t offset : {uint64_t{1}, uint64_t{1} << 32, uint64_t{1} << 53, uint64_t{1} << 63}) {
    EXPECT_THAT(error_with("/accessors/0/byteOffset", offset), HasSubstr("accessors[0]"));
    const uint64_t view_offset = std::max<uint64_t>(offset, 1000);
    EXPECT_THAT(error_with("/bufferViews/0/byteOffset", view_offset), HasSubstr("bufferViews[0]"));
  }
  EXPECT_THAT(error_with("/bufferViews/2/byteLength", 7), HasSubstr("bufferViews[2].byteLength: expected a view"));
  EXPECT_THAT(error_with("/bufferViews/0/byteLength", 35), HasSubstr("accessors[0]: expected values inside"));
  for (const uint64_t count : {uint64_t{4}, uint64_t{1} << 32, (uint64_t{1} << 53) / 12, uint64_t{1} << 53}) {
    EXPECT_THAT(error_with("/accessors/0/count", count), HasSubstr("accessors[0]: expected values inside"));
  }
  EXPECT_THAT(error_with("/bufferViews/0/byteStride", 8), HasSubstr("accessors[0]: expected elements of at most"));
  EXPECT_THAT(error_with("/bufferViews/0/byteStride", 16), HasSubstr("accessors[0]: expected values inside"));
  EXPECT_THAT(error_with("/bufferViews/0/byteStride", 1 << 20), HasSubstr("bufferViews[0].byteStride"));
}

TEST(HostileGltf, BoundsCountsThatNoByteStandsBehind) {
  GltfScene scene;
  scene.add_accessor({{"type", "VEC3"}, {"componentType", kFloat}, {"count", 1ull << 40}});
  EXPECT_THAT(load_error(scene), HasSubstr("accessors[0].count: expected a whole number from 0 to 16777216"));
}

TEST(HostileGltf, RefusesSparseAccessorsThatLeaveTheirViews) {
  GltfScene scene = triangle_scene();
  scene.root["accessors"][0]["sparse"] = {{"count", 2},
                                          {"indices", {{"bufferView", 2}, {"componentType", kUnsignedShort}}},
                                          {"values", {{"bufferView", 1}}}};
  EXPECT_EQ(load_error(scene), "");
  GltfScene bad = scene;
  bad.root["accessors"][0]["sparse"]["count"] = 4;
  EXPECT_THAT(load_error(bad), HasSubstr("accessors[0].sparse.count: expected at most the 3"));
  bad = scene;
  bad.root["accessors"][0]["sparse"]["indices"]["componentType"] = kFloat;
  EXPECT_THAT(load_error(bad), HasSubstr("accessors[0].sparse.indices.componentType"));
  bad = scene;
  bad.root["accessors"][0]["sparse"]["indices"]["byteOffset"] = 3;
  EXPECT_THAT(load_error(bad), HasSubstr("accessors[0].sparse.indices: expected values inside"));
  bad = scene;
  bad.root["accessors"][0]["sparse"]["values"]["bufferView"] = 2;
  EXPECT_THAT(load_error(bad), HasSubstr("accessors[0].sparse.values: expected values inside"));
}

TEST(HostileGltf, RefusesIndicesOutOfRangeEverywhere) {
  const char* const pointers[] = {"/meshes/0/primitives/0/indices",
                                  "/meshes/0/primitives/0/material",
                                  "/nodes/0/mesh",
                                  "/nodes/1/camera",
                                  "/nodes/0/skin",
                                  "/scene",
                                  "/scenes/0/nodes/0",
                                  "/textures/0/source",
                                  "/textures/0/sampler",
                                  "/bufferViews/0/buffer",
                                  "/accessors/0/bufferView",
                                  "/materials/0/pbrMetallicRoughness/baseColorTexture/index"};
  for (const char* pointer : pointers) {
    for (const json& bad : {json(1000), json(-1), json(4294967296u), json(0.5), json("x")}) {
      EXPECT_NE(error_with(pointer, bad), "") << pointer << " " << bad;
    }
  }
}

TEST(HostileGltf, RefusesAttributesOfTheWrongShape) {
  EXPECT_THAT(error_with("/accessors/0/type", "VEC2"), HasSubstr("attributes.POSITION: expected an accessor of 3"));
  EXPECT_THAT(error_with("/accessors/1/count", 2), HasSubstr("attributes.NORMAL: expected 3 elements"));
  EXPECT_THAT(error_with("/accessors/2/componentType", kShort),
              HasSubstr("primitives[0].indices: expected an accessor"));
  EXPECT_THAT(error_with("/accessors/2/componentType", 5124), HasSubstr("accessors[2].componentType"));
  EXPECT_THAT(error_with("/accessors/2/type", "VEC9"), HasSubstr("accessors[2].type"));
  EXPECT_THAT(error_with("/meshes/0/primitives/0/mode", 7), HasSubstr("primitives[0].mode"));
}

TEST(HostileGltf, RefusesSectionsOfTheWrongKind) {
  for (const char* section :
       {"buffers", "bufferViews", "accessors", "images", "samplers", "textures", "materials", "meshes", "cameras",
        "nodes", "scenes", "skins", "animations", "extensionsUsed", "extensionsRequired"}) {
    for (const json& bad : {json(3), json("x"), json::object(), json::array({3, nullptr})}) {
      GltfScene scene = triangle_scene();
      scene.root[section] = bad;
      const std::string error = load_error(scene);
      if (bad.is_array()) continue;  // accepted for what is not read, such as skins
      EXPECT_THAT(error, HasSubstr(section));
    }
  }
}

TEST(HostileGltf, RefusesUrisThatLeaveTheFolder) {
  for (const char* uri : {"../secret", "a/../../secret", "/etc/passwd", "%2e%2e/secret", "a/%2E./x", "..",
                          "http://example.com/x", "file:///etc/passwd", "C:/x", "a%00b", "bad%zz", "bad%2"}) {
    EXPECT_THAT(error_with("/images/0/uri", uri), HasSubstr("images[0].uri: expected")) << uri;
    EXPECT_THAT(error_with("/buffers/0/uri", uri), HasSubstr("buffers[0].uri: expected")) << uri;
    EXPECT_FALSE(resolve_uri("dir", uri).ok()) << uri;
  }
  EXPECT_EQ(resolve_uri("dir", "a%20b/..c/d%2Fe.bin").value(), "dir/a b/..c/d/e.bin");
  EXPECT_EQ(resolve_uri("", "a.bin").value(), "a.bin");
  EXPECT_EQ(resolve_uri("/", "a.bin").value(), "/a.bin");
}

TEST(HostileGltf, RefusesDataUrisThatAreNotBase64) {
  for (const char* uri :
       {"data:", "data:text/plain,hello", "data:;base64,a", "data:;base64,a*==", "data:;base64"}) {
    EXPECT_THAT(error_with("/images/0/uri", uri), HasSubstr("images[0].uri: expected")) << uri;
  }
  EXPECT_THAT(error_with("/buffers/0/uri", "data:;base64,AQID"), HasSubstr("at most the 3 bytes of the URI"));
}

TEST(HostileGltf, RefusesTextThatIsNotAGltf) {
  MemoryFileSystem fs;
  for (const std::string& text : {std::string(), std::string("["), std::string("[]"), std::string("{}"),
                                  std::string("{\"asset\":{\"version\":\"1.0\"}}"), std::string("{\"asset\":3}"),
                                  std::string("{\"asset\":{\"version\":\"2.0\"}} x"), std::string("\xff\xfe{}"),
                                  std::string("{\"asset\":{\"version\":\"2.0\"},\"scene\":1e999}")}) {
    fs.put("a.gltf", text);
    const auto document = load_document(fs, "a.gltf");
    ASSERT_FALSE(document.ok()) << text;
    EXPECT_EQ(document.error().code, ErrorCode::kInput);
    EXPECT_THAT(document.error().message, StartsWith("a.gltf: "));
  }
}

TEST(HostileGltf, BoundsNestingAndTheNumberOfValuesBeforeParsing) {
  MemoryFileSystem fs;
  const auto error_of = [&](const std::string& extras, const Limits& limits = {}) {
    fs.put("a.gltf", fmt::format(R"({{"asset":{{"version":"2.0"}},"extras":{}}})", extras));
    const auto document = load_document(fs, "a.gltf", limits);
    return document.ok() ? std::string() : document.error().message;
  };
  EXPECT_EQ(error_of(std::string(63, '[') + std::string(63, ']')), "");
  EXPECT_THAT(error_of(std::string(64, '[') + std::string(64, ']')), HasSubstr("nested at most 64 deep"));
  EXPECT_THAT(error_of(std::string(1000000, '[')), HasSubstr("nested at most 64 deep"));
  EXPECT_EQ(error_of(fmt::format(R"("{}\"{}")", std::string(1000, '['), std::string(1000, '{'))), "");
  Limits limits;
  limits.json_values_count = 100;
  EXPECT_THAT(error_of(fmt::format("[{}]", std::string(100, ',')), limits), HasSubstr("at most 100 JSON values"));
  limits = {};
  limits.json_bytes = 100;
  EXPECT_THAT(error_of(fmt::format(R"("{}")", std::string(100, 'x')), limits),
              HasSubstr("at most 100 bytes of JSON"));
  limits = {};
  limits.objects_count = 5;
  fs.put("a.gltf", R"({"asset":{"version":"2.0"},"nodes":[{},{},{},{},{},{}]})");
  EXPECT_THAT(load_document(fs, "a.gltf", limits).error().message,
              HasSubstr("nodes: expected an array of at most 5"));
}

TEST(HostileGltf, RefusesFilesCutOffAnywhere) {
  const GltfScene scene = triangle_scene();
  MemoryFileSystem fs;
  for (const std::string& path : {scene.put(fs), scene.put_glb(fs)}) {
    const auto bytes = fs.contents(path);
    for (size_t size = 0; size < bytes.size(); ++size) {
      fs.put(path, std::vector<std::byte>(bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(size)));
      const auto document = load_document(fs, path);
      ASSERT_FALSE(document.ok()) << path << " cut to " << size;
      ASSERT_EQ(document.error().code, ErrorCode::kInput);
    }
  }
}

TEST(HostileGltf, ShowsNoControlCharactersOfTheFileInMessages) {
  GltfScene scene = triangle_scene();
  scene.root["extensionsRequired"] = {"\x1b[31mred"};
  EXPECT_THAT(load_error(scene), HasSubstr("?[31mred"));
}

}  // namespace
}  // namespace shoal::gltf
