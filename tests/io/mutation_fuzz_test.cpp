// Valid files, damaged at random with fixed seeds: whatever comes of it, nothing crashes and nothing runs away. Run
// it under the asan preset.
#include <gtest/gtest.h>
#include <png.h>

#include <functional>
#include <random>

#include "io/image.h"
#include "tests/io/gltf_scene.h"
#include "tests/io/image_samples.h"

namespace shoal {
namespace {

using Bytes = std::vector<std::byte>;

/// One to four edits: bits, bytes, interesting words, copies of other places, cuts.
Bytes mutate(const Bytes& source, std::mt19937& random) {
  constexpr uint32_t kWords[] = {0,      1,          0x7f,        0xff,        0x7fff,
                                 0xffff, 0x7fffffff, 0x80000000u, 0xffffffffu, 0x01000000};
  Bytes bytes = source;
  for (uint32_t edits = 1 + random() % 4; edits > 0 && bytes.size() > 4; --edits) {
    const size_t at = random() % (bytes.size() - 3);
    switch (random() % 6) {
      case 0:
        bytes[at] ^= static_cast<std::byte>(1u << random() % 8);
        break;
      case 1:
        bytes[at] = static_cast<std::byte>(random());
        break;
      case 2: {
        const uint32_t word = kWords[random() % std::size(kWords)];
        for (size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<std::byte>(word >> 8 * i);
        break;
      }
      case 3:
        for (size_t i = 0, from = random() % (bytes.size() - 3); i < 4; ++i) bytes[at + i] = bytes[from + i];
        break;
      case 4:
        bytes.erase(bytes.begin() + static_cast<ptrdiff_t>(at),
                    bytes.begin() + static_cast<ptrdiff_t>(at + 1 + random() % 3));
        break;
      default:
        if (random() % 8 == 0) bytes.resize(at);
        break;
    }
  }
  return bytes;
}

void for_each_mutant(const Bytes& source, uint32_t count, const std::function<void(const Bytes&)>& visit) {
  std::mt19937 random(42);
  for (uint32_t i = 0; i < count; ++i) visit(mutate(source, random));
}

/// Damages digits of the JSON only, so that many mutants still parse.
Bytes mutate_digits(const Bytes& source, std::mt19937& random) {
  Bytes bytes = source;
  for (int edits = 0; edits < 3;) {
    std::byte& byte = bytes[random() % bytes.size()];
    if (byte < std::byte{'0'} || byte > std::byte{'9'}) {
      edits += random() % 64 == 0;
      continue;
    }
    constexpr char kInstead[] = "0123456789-.e";
    byte = static_cast<std::byte>(kInstead[random() % (sizeof kInstead - 1)]);
    ++edits;
  }
  return bytes;
}

gltf::GltfScene rich_scene() {
  gltf::GltfScene scene = gltf::triangle_scene();
  const uint32_t indices = scene.add_view<uint16_t>({0, 2}), values = scene.add_view<float>({1, 2, 3, 4, 5, 6});
  scene.root["accessors"][0]["sparse"] = {
      {"count", 2},
      {"indices", {{"bufferView", indices}, {"componentType", gltf::kUnsignedShort}}},
      {"values", {{"bufferView", values}}}};
  scene.root["meshes"][0]["primitives"].push_back({{"attributes", {{"POSITION", 1}}}, {"mode", 5}});
  scene.root["images"].push_back({{"uri", "data:image/png;base64,iVBORw0KGgo="}});
  scene.root["nodes"][0]["children"] = nlohmann::json::array();
  const uint32_t times = scene.add_accessor<float>({0, 1}, "SCALAR", gltf::kFloat, 2);
  const uint32_t moves = scene.add_accessor<float>({0, 0, 0, 1, 1, 1}, "VEC3", gltf::kFloat, 2);
  scene.root["skins"] = {{{"joints", {1, 0}}}};
  scene.root["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", 0}}};
  scene.root["meshes"][0]["primitives"][1]["targets"] = {{{"POSITION", 1}}};
  scene.root["meshes"][0]["weights"] = {0.5};
  scene.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"TRANSLATION", moves}};
  scene.root["animations"] = {{{"channels", {{{"sampler", 0}, {"target", {{"node", 1}, {"path", "translation"}}}}}},
                               {"samplers", {{{"input", times}, {"output", moves}}}}}};
  return scene;
}

TEST(MutationFuzz, DamagedGltfDocumentsAreReadOrRefused) {
  MemoryFileSystem fs;
  const std::string path = rich_scene().put(fs);
  const Bytes source = fs.contents(path);
  uint32_t read_count = 0;
  const auto visit = [&](const Bytes& bytes) {
    fs.put(path, bytes);
    const auto document = gltf::load_document(fs, path);
    if (!document.ok()) return;
    ++read_count;
    gltf::read_everything(fs, document.value());
  };
  for_each_mutant(source, 2000, visit);
  std::mt19937 random(5);
  for (int i = 0; i < 3000; ++i) visit(mutate_digits(source, random));
  EXPECT_GT(read_count, 50u);  // else the mutants test the JSON parser only
}

TEST(MutationFuzz, DamagedGlbFilesAreReadOrRefused) {
  MemoryFileSystem fs;
  const std::string path = rich_scene().put_glb(fs);
  const Bytes source = fs.contents(path);
  for_each_mutant(source, 3000, [&](const Bytes& bytes) {
    fs.put(path, bytes);
    const auto document = gltf::load_document(fs, path);
    if (document.ok()) gltf::read_everything(fs, document.value());
  });
}

std::vector<uint8_t> noise(size_t n) {
  std::mt19937 random(3);
  std::vector<uint8_t> bytes(n);
  for (auto& byte : bytes) byte = static_cast<uint8_t>(random() % 40 + n % 100);
  return bytes;
}

TEST(MutationFuzz, DamagedPicturesAreReadOrRefused) {
  constexpr uint64_t kPixels = 1 << 16;
  const Bytes pictures[] = {make_png(16, 16, PNG_COLOR_TYPE_RGB_ALPHA, 8, true, noise(1024)),
                            make_png(16, 16, PNG_COLOR_TYPE_PALETTE, 4, false, std::vector<uint8_t>(128, 0x12),
                                     {1, 2, 3, 4, 5, 6, 7, 8, 9}, {5}),
                            make_jpeg(24, 24, 3, false, noise(1728)), make_jpeg(24, 24, 3, true, noise(1728)),
                            make_jpeg(24, 24, 1, false, noise(576))};
  for (const Bytes& picture : pictures) {
    ASSERT_TRUE(decode_image(picture, "whole", kPixels).ok());
    for_each_mutant(picture, 1000, [&](const Bytes& bytes) {
      const auto image = decode_image(bytes, "mutant", kPixels);
      if (!image.ok()) return;
      EXPECT_EQ(image.value().rgba.size(), uint64_t{4} * image.value().width * image.value().height);
    });
  }
}

TEST(MutationFuzz, DamagedExrFilesAreReadOrRefused) {
  ExrImage image;
  image.width = 20;
  image.height = 40;
  for (const char* name : {"R", "G", "B"}) {
    ExrChannel channel{name, *name == 'G', {}};
    for (const uint8_t value : noise(800)) channel.values.push_back(value);
    image.channels.push_back(channel);
  }
  image.text["software"] = "shoal";
  MemoryFileSystem fs;
  ASSERT_TRUE(write_exr(fs, "a.exr", image).ok());
  for_each_mutant(fs.contents("a.exr"), 3000, [&](const Bytes& bytes) {
    fs.put("b.exr", bytes);
    (void)read_exr(fs, "b.exr", 1 << 16).ok();
    (void)read_hdr_image(fs, "b.exr", 1 << 16).ok();
  });
}

TEST(MutationFuzz, DamagedRadianceFilesAreReadOrRefused) {
  std::string text = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 3 +X 9\n";
  for (int y = 0; y < 2; ++y) text += std::string("\2\2\0\x09\x89\1\x83\1\6\1\2\3\4\5\6\x89\0\x89\x81", 19);
  text += std::string("\x80\1\2\x81\1\1\1\x08", 8);
  MemoryFileSystem fs;
  fs.put("a.hdr", text);
  ASSERT_TRUE(read_hdr_image(fs, "a.hdr", 1 << 16).ok());
  for_each_mutant(fs.contents("a.hdr"), 5000, [&](const Bytes& bytes) {
    fs.put("b.hdr", bytes);
    (void)read_hdr_image(fs, "b.hdr", 1 << 16).ok();
  });
}

}  // namespace
}  // namespace shoal
