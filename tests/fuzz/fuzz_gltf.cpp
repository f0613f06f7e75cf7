// glTF documents from strangers: JSON or GLB, their accessors, triangles, compressed meshes and embedded pictures.
// A text input ends at its first zero byte; what follows is the file scene.bin beside it.
#include <algorithm>
#include <string>

#include "io/decompress_document.h"
#include "io/image.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/support/memory_file_system.h"

namespace shoal::fuzz {
namespace {

constexpr uint64_t kMostElements = 4096;      // of an accessor at once: crosses no budget and every check
constexpr uint64_t kMostDecoded = 16u << 20;  // of compressed meshes: what more takes is refused by the memory plan

std::string put_document(MemoryFileSystem& fs, const std::vector<std::byte>& bytes) {
  const bool text = !bytes.empty() && bytes[0] != std::byte{'g'};
  if (!text) {
    fs.put("dir/scene.glb", bytes);
    return "dir/scene.glb";
  }
  const auto zero = std::find(bytes.begin(), bytes.end(), std::byte{0});
  fs.put("dir/scene.gltf", std::vector<std::byte>(bytes.begin(), zero));
  fs.put("dir/scene.bin", std::vector<std::byte>(zero == bytes.end() ? zero : zero + 1, bytes.end()));
  return "dir/scene.gltf";
}

void read_accessors(FileSystem& fs, const gltf::Document& document) {
  gltf::BufferFiles files(fs, document);
  for (uint32_t i = 0; i < std::min<size_t>(document.accessors.size(), 64); ++i) {
    auto reader = gltf::AccessorReader::open(files, document, i);
    if (!reader.ok()) continue;
    const uint64_t count = reader.value().count(), n = std::min(count, kMostElements);
    std::vector<float> values(n * reader.value().components());
    std::vector<uint32_t> indices(n);
    (void)reader.value().read_floats(0, n, values).ok();
    (void)reader.value().read_floats(count - n, n, values).ok();
    (void)reader.value().read_indices(0, n, indices).ok();
  }
}

void read_triangles(FileSystem& fs, const gltf::Document& document) {
  gltf::BufferFiles files(fs, document);
  for (const gltf::Mesh& mesh : document.meshes) {
    for (const gltf::Primitive& primitive : mesh.primitives) {
      auto stream = gltf::TriangleStream::open(files, document, primitive);
      if (!stream.ok()) continue;
      const uint64_t n = std::min(stream.value().count(), kMostElements);
      std::vector<uint32_t> indices(3 * n);
      if (!stream.value().read(stream.value().count() - n, n, indices).ok()) continue;
      for (const uint32_t index : indices) require(index < stream.value().vertex_count());
    }
  }
}

void read_images(FileSystem& fs, const gltf::Document& document) {
  gltf::BufferFiles files(fs, document);
  for (const gltf::Image& image : document.images) {
    std::vector<std::byte> bytes = image.embedded;
    if (image.view) {
      const gltf::BufferView& view = document.views[*image.view];
      if (view.meshopt || view.byte_length > kMostDecoded || !files.check(view.buffer).ok()) continue;
      bytes.resize(view.byte_length);
      if (!files.read(view.buffer, view.byte_offset, bytes).ok()) continue;
    }
    if (!bytes.empty()) (void)decode_image(bytes, image.name, kMaxPixels).ok();
  }
}

void read_everything(FileSystem& fs, gltf::Document document) {
  read_accessors(fs, document);
  read_triangles(fs, document);
  read_images(fs, document);
  for (const std::string& variant : document.variants) require(gltf::select_variant(document, variant).ok());
  const gltf::CompressionNeeds needs = gltf::compression_needs(document);
  if (needs.scratch_bytes == 0 || needs.scratch_bytes > kMostDecoded || needs.memory_bytes > kMostDecoded) return;
  if (!gltf::decompress(fs, "scratch", nullptr, document).ok()) return;
  read_accessors(fs, document);
  read_triangles(fs, document);
}

}  // namespace
}  // namespace shoal::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  shoal::MemoryFileSystem fs;
  const std::string path = shoal::fuzz::put_document(fs, shoal::fuzz::bytes_of(data, size));
  (void)shoal::gltf::json_hash(fs, path).ok();
  auto document = shoal::gltf::load_document(fs, path);
  if (document.ok()) {
    shoal::fuzz::read_everything(fs, std::move(document).value());
  } else {
    using enum shoal::ErrorCode;
    shoal::fuzz::require(document.error().code == kInput || document.error().code == kUnsupported);
  }
  return 0;
}
