#include "tests/io/gltf_scene.h"

#include <gtest/gtest.h>

#include "io/image.h"

namespace shoal::gltf {

using nlohmann::json;

GltfScene::GltfScene() { root = {{"asset", {{"version", "2.0"}}}}; }

uint32_t GltfScene::add_view_bytes(std::span<const std::byte> bytes, uint32_t stride) {
  binary.resize((binary.size() + 3) / 4 * 4);
  json view = {{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", bytes.size()}};
  if (stride != 0) view["byteStride"] = stride;
  binary.insert(binary.end(), bytes.begin(), bytes.end());
  root["bufferViews"].push_back(view);
  return static_cast<uint32_t>(root["bufferViews"].size() - 1);
}

uint32_t GltfScene::add_accessor(const json& accessor) {
  root["accessors"].push_back(accessor);
  return static_cast<uint32_t>(root["accessors"].size() - 1);
}

uint32_t GltfScene::add_mesh(const json& primitive) {
  root["meshes"].push_back({{"primitives", json::array({primitive})}});
  root["nodes"].push_back({{"mesh", root["meshes"].size() - 1}});
  return static_cast<uint32_t>(root["meshes"].size() - 1);
}

std::string GltfScene::put(MemoryFileSystem& fs) const {
  json text = root;
  if (!text.contains("buffers") && !binary.empty()) {
    text["buffers"] = json::array({{{"uri", "scene.bin"}, {"byteLength", binary.size()}}});
  }
  fs.put("dir/scene.bin", binary);
  fs.put("dir/scene.gltf", text.dump());
  return "dir/scene.gltf";
}

std::string GltfScene::put_glb(MemoryFileSystem& fs) const {
  json text = root;
  text["buffers"] = json::array({{{"byteLength", binary.size()}}});
  std::string chunk = text.dump();
  chunk.resize((chunk.size() + 3) / 4 * 4, ' ');
  std::vector<std::byte> bin = binary;
  bin.resize((bin.size() + 3) / 4 * 4);
  std::vector<std::byte> bytes;
  const auto word = [&](uint64_t value) {
    for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<std::byte>(value >> 8 * i));
  };
  word(0x46546c67), word(2), word(12 + 8 + chunk.size() + 8 + bin.size());
  word(chunk.size()), word(0x4e4f534a);
  for (const char c : chunk) bytes.push_back(static_cast<std::byte>(c));
  word(bin.size()), word(0x004e4942);
  bytes.insert(bytes.end(), bin.begin(), bin.end());
  fs.put("dir/scene.glb", bytes);
  return "dir/scene.glb";
}

GltfScene triangle_scene() {
  GltfScene scene;
  const uint32_t position = scene.add_accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3", kFloat, 3);
  const uint32_t normal = scene.add_accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3", kFloat, 3);
  const uint32_t indices = scene.add_accessor<uint16_t>({0, 1, 2}, "SCALAR", kUnsignedShort, 3);
  scene.root["images"] = {{{"uri", "a%20b.png"}}};
  scene.root["samplers"] = {{{"wrapS", 33071}, {"magFilter", 9728}}};
  scene.root["textures"] = {{{"source", 0}, {"sampler", 0}}};
  scene.root["materials"] = {
      {{"name", "paint"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}, {"texCoord", 1}}}}}}};
  scene.root["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 0.1}}}}};
  scene.add_mesh(
      {{"attributes", {{"POSITION", position}, {"NORMAL", normal}}}, {"indices", indices}, {"material", 0}});
  scene.root["nodes"].push_back({{"camera", 0}, {"translation", {1, 2, 3}}});
  scene.root["scenes"] = {{{"nodes", {0, 1}}}};
  return scene;
}

std::string load_error(const GltfScene& scene, const Limits& limits) {
  MemoryFileSystem fs;
  const auto document = load_document(fs, scene.put(fs), limits);
  if (document.ok()) return "";
  EXPECT_TRUE(document.error().code == ErrorCode::kInput || document.error().code == ErrorCode::kUnsupported);
  return document.error().message;
}

std::vector<float> read_all(FileSystem& fs, const Document& document, uint32_t accessor) {
  BufferFiles files(fs, document);
  auto reader = AccessorReader::open(files, document, accessor);
  if (!reader.ok()) {
    ADD_FAILURE() << reader.error().message;
    return {};
  }
  std::vector<float> values(reader.value().count() * reader.value().components());
  const Status status = reader.value().read_floats(0, reader.value().count(), values);
  EXPECT_TRUE(status.ok()) << status.error().message;
  return values;
}

std::vector<uint32_t> read_triangles(FileSystem& fs, const Document& document, uint32_t mesh) {
  BufferFiles files(fs, document);
  auto stream = TriangleStream::open(files, document, document.meshes[mesh].primitives[0]);
  if (!stream.ok()) {
    ADD_FAILURE() << stream.error().message;
    return {};
  }
  std::vector<uint32_t> indices(3 * stream.value().count());
  const Status status = stream.value().read(0, stream.value().count(), indices);
  EXPECT_TRUE(status.ok()) << status.error().message;
  return indices;
}

namespace {

constexpr uint64_t kMost = 4096;  // elements read at once; enough to cross no budget and every check

void read_accessors_of(FileSystem& fs, const Document& document) {
  BufferFiles files(fs, document);
  for (uint32_t i = 0; i < document.accessors.size(); ++i) {
    auto reader = AccessorReader::open(files, document, i);
    if (!reader.ok()) continue;
    const uint64_t n = std::min(reader.value().count(), kMost);
    std::vector<float> values(n * reader.value().components());
    std::vector<uint32_t> indices(n);
    (void)reader.value().read_floats(0, n, values).ok();
    (void)reader.value().read_floats(reader.value().count() - n, n, values).ok();
    (void)reader.value().read_indices(0, n, indices).ok();
  }
}

}  // namespace

void read_everything(FileSystem& fs, const Document& document) {
  read_accessors_of(fs, document);
  BufferFiles files(fs, document);
  for (const Mesh& mesh : document.meshes) {
    for (const Primitive& primitive : mesh.primitives) {
      auto stream = TriangleStream::open(files, document, primitive);
      if (!stream.ok()) continue;
      const uint64_t n = std::min(stream.value().count(), kMost);
      std::vector<uint32_t> indices(3 * n);
      const Status status = stream.value().read(stream.value().count() - n, n, indices);
      if (!status.ok()) continue;
      for (const uint32_t index : indices) EXPECT_LT(index, stream.value().vertex_count());
    }
  }
  for (const Image& image : document.images) {
    if (!image.embedded.empty()) (void)decode_image(image.embedded, image.name, 1 << 20).ok();
  }
}

}  // namespace shoal::gltf
