#include "tests/support/written_scene.h"

#include <algorithm>
#include <cstring>

namespace shoal::testing {

namespace {

constexpr const char* kTypeNames[] = {"", "SCALAR", "VEC2", "VEC3", "VEC4"};

void put_big_endian(std::string& out, uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<char>(value >> shift));
}

uint32_t crc32(const std::string& bytes) {
  uint32_t crc = 0xffffffffu;
  for (const char c : bytes) {
    crc ^= static_cast<uint8_t>(c);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) ? 0xedb88320u : 0);
  }
  return ~crc;
}

void put_chunk(std::string& png, const std::string& type, const std::string& data) {
  put_big_endian(png, static_cast<uint32_t>(data.size()));
  png += type + data;
  put_big_endian(png, crc32(type + data));
}

/// zlib with stored blocks.
std::string stored_zlib(const std::string& raw) {
  std::string out = "\x78\x01";
  uint32_t a = 1, b = 0;
  for (const char c : raw) a = (a + static_cast<uint8_t>(c)) % 65521, b = (b + a) % 65521;
  for (size_t at = 0; at < raw.size(); at += 65535) {
    const size_t n = std::min<size_t>(65535, raw.size() - at);
    out.push_back(at + n == raw.size() ? 1 : 0);
    for (const size_t v : {n, ~n}) out.push_back(static_cast<char>(v)), out.push_back(static_cast<char>(v >> 8));
    out.append(raw, at, n);
  }
  put_big_endian(out, b << 16 | a);
  return out;
}

}  // namespace

std::string png_bytes(uint32_t width, uint32_t height, const std::vector<uint8_t>& rgba) {
  std::string header, raw, png = "\x89PNG\r\n\x1a\n";
  put_big_endian(header, width);
  put_big_endian(header, height);
  header += std::string("\x08\x06\x00\x00\x00", 5);
  for (uint32_t y = 0; y < height; ++y) {
    raw.push_back(0);
    raw.append(reinterpret_cast<const char*>(rgba.data()) + size_t{4} * width * y, size_t{4} * width);
  }
  put_chunk(png, "IHDR", header);
  put_chunk(png, "IDAT", stored_zlib(raw));
  put_chunk(png, "IEND", "");
  return png;
}

WrittenScene::WrittenScene() {
  json = {{"asset", {{"version", "2.0"}}}, {"scene", 0}, {"scenes", {{{"nodes", nlohmann::json::array()}}}}};
}

uint32_t WrittenScene::add_accessor(const void* bytes, size_t size, uint32_t component_type, uint32_t components,
                                    size_t count) {
  binary_.resize((binary_.size() + 3) / 4 * 4);
  json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", binary_.size()}, {"byteLength", size}});
  binary_.append(static_cast<const char*>(bytes), size);
  json["accessors"].push_back({{"bufferView", json["bufferViews"].size() - 1},
                               {"componentType", component_type},
                               {"type", kTypeNames[components]},
                               {"count", count}});
  return static_cast<uint32_t>(json["accessors"].size() - 1);
}

uint32_t WrittenScene::add_floats(uint32_t components, const std::vector<float>& values) {
  return add_accessor(values.data(), values.size() * 4, 5126, components, values.size() / components);
}

uint32_t WrittenScene::add_indices(const std::vector<uint32_t>& values) {
  return add_accessor(values.data(), values.size() * 4, 5125, 1, values.size());
}

uint32_t WrittenScene::add_bytes(uint32_t components, const std::vector<uint8_t>& values, bool normalized) {
  const uint32_t accessor =
      add_accessor(values.data(), values.size(), 5121, components, values.size() / components);
  json["accessors"][accessor]["normalized"] = normalized;
  return accessor;
}

uint32_t WrittenScene::add_mesh(const nlohmann::json& primitive) {
  json["meshes"].push_back({{"primitives", {primitive}}});
  return static_cast<uint32_t>(json["meshes"].size() - 1);
}

uint32_t WrittenScene::add_triangle_mesh(float x, float size) {
  return add_mesh({{"attributes", {{"POSITION", add_floats(3, {x, 0, 0, x + size, 0, 0, x, size, 0})}}}});
}

uint32_t WrittenScene::add_node(const nlohmann::json& node) {
  json["nodes"].push_back(node);
  const auto index = static_cast<uint32_t>(json["nodes"].size() - 1);
  json["scenes"][0]["nodes"].push_back(index);
  return index;
}

uint32_t WrittenScene::add_texture(MemoryFileSystem& fs, uint32_t width, uint32_t height,
                                   const std::vector<uint8_t>& rgba) {
  const std::string name = "image" + std::to_string(json.contains("images") ? json["images"].size() : 0) + ".png";
  fs.put(name, png_bytes(width, height, rgba));
  json["images"].push_back({{"uri", name}});
  json["textures"].push_back({{"source", json["images"].size() - 1}});
  return static_cast<uint32_t>(json["textures"].size() - 1);
}

void WrittenScene::save(MemoryFileSystem& fs) const {
  nlohmann::json out = json;
  if (!binary_.empty()) out["buffers"] = {{{"uri", "scene.bin"}, {"byteLength", binary_.size()}}};
  fs.put("scene.bin", binary_);
  fs.put("scene.gltf", out.dump());
}

}  // namespace shoal::testing
