// Scenes made by others: all load, and every accessor, triangle and picture is read to its end.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "io/gltf_accessor.h"
#include "io/image.h"

namespace shoal::gltf {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> scene_paths() {
  std::vector<std::string> paths;
  const char* const data = std::getenv("SHOAL_DATA");
  if (data == nullptr) return paths;
  for (const auto& entry : fs::recursive_directory_iterator(fs::path(data) / "scenes")) {
    const std::string extension = entry.path().extension();
    if (entry.is_regular_file() && (extension == ".gltf" || extension == ".glb")) paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

void read_accessors(BufferFiles& files, const Document& document) {
  constexpr uint64_t kRun = 10000;
  std::vector<float> values;
  for (uint32_t i = 0; i < document.accessors.size(); ++i) {
    auto reader = AccessorReader::open(files, document, i);
    ASSERT_TRUE(reader.ok()) << reader.error().message;
    for (uint64_t first = 0; first < reader.value().count(); first += kRun) {
      const uint64_t n = std::min(kRun, reader.value().count() - first);
      values.resize(n * reader.value().components());
      const Status status = reader.value().read_floats(first, n, values);
      ASSERT_TRUE(status.ok()) << status.error().message;
      for (const float value : values) ASSERT_TRUE(std::isfinite(value)) << document.path << " accessor " << i;
    }
  }
}

uint64_t read_triangles(BufferFiles& files, const Document& document) {
  uint64_t count = 0;
  std::vector<uint32_t> indices;
  for (const Mesh& mesh : document.meshes) {
    for (const Primitive& primitive : mesh.primitives) {
      auto stream = TriangleStream::open(files, document, primitive);
      EXPECT_TRUE(stream.ok()) << stream.error().message;
      if (!stream.ok()) continue;
      indices.resize(3 * stream.value().count());
      const Status status = stream.value().read(0, stream.value().count(), indices);
      EXPECT_TRUE(status.ok()) << status.error().message;
      count += stream.value().count();
    }
  }
  return count;
}

void read_pictures(BufferFiles& files, const Document& document) {
  constexpr uint64_t kPixels = 1 << 24;
  for (const Image& image : document.images) {
    std::vector<std::byte> bytes = image.embedded;
    if (image.view) {
      const BufferView& view = document.views[*image.view];
      bytes.resize(view.byte_length);
      ASSERT_TRUE(files.read(view.buffer, view.byte_offset, bytes).ok());
    } else if (!image.path.empty()) {
      const auto file = read_whole_file(posix_file_system(), image.path, 1 << 28);
      ASSERT_TRUE(file.ok()) << file.error().message;
      const auto span = std::as_bytes(std::span(file.value()));
      bytes.assign(span.begin(), span.end());
    }
    const auto decoded = decode_image(bytes, image.name, kPixels);
    ASSERT_TRUE(decoded.ok()) << decoded.error().message;
  }
}

TEST(RealScenes, LoadAndAreReadToTheirEnd) {
  const auto paths = scene_paths();
  if (paths.empty()) GTEST_SKIP() << "SHOAL_DATA names no folder with scenes";
  uint64_t triangles_count = 0;
  for (const std::string& path : paths) {
    SCOPED_TRACE(path);
    const auto document = load_document(posix_file_system(), path);
    ASSERT_TRUE(document.ok()) << document.error().message;
    BufferFiles files(posix_file_system(), document.value());
    read_accessors(files, document.value());
    triangles_count += read_triangles(files, document.value());
    read_pictures(files, document.value());
  }
  EXPECT_GT(triangles_count, 0u);
}

}  // namespace
}  // namespace shoal::gltf
