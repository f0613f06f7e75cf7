#include "engine/gltf_writer.h"

#include <gtest/gtest.h>

#include <map>
#include <tuple>

#include "engine/generate_surfaces.h"
#include "io/gltf_accessor.h"
#include "tests/support/faulty_file_system.h"
#include "tests/support/memory_file_system.h"

namespace shoal {
namespace {

uint64_t peak_buffered_bytes_of_grid(uint64_t side) {
  MemoryFileSystem fs;
  auto writer = GltfWriter::create(fs, "out", "grid");
  SurfaceWriter surfaces(*writer.value());
  gltf::Mesh mesh;
  surfaces.add_grid(
      mesh, {side, side}, [](uint64_t i, uint64_t j) { return Vec3(i, j, 0); }, 0);
  return writer.value()->peak_buffered_bytes();
}

TEST(GltfWriter, HoldsNoMoreBytesForManyTrianglesThanItsBuffer) {
  EXPECT_LE(peak_buffered_bytes_of_grid(64), 1u << 20);
  EXPECT_LE(peak_buffered_bytes_of_grid(1200), 1u << 20);
}

TEST(GltfWriter, StartsANewPartWhenOneIsFullAndShowsNothingBeforeFinish) {
  MemoryFileSystem fs;
  auto writer = GltfWriter::create(fs, "out", "parts", {.part_bytes = 1000, .buffer_bytes = 64});
  ASSERT_TRUE(writer.ok());
  gltf::Mesh mesh;
  for (int k = 0; k < 5; ++k) {
    writer.value()->begin_accessor(AccessorKind::kPosition, k == 3 ? 200 : 30);
    for (int i = 0; i < (k == 3 ? 200 : 30); ++i) {
      const float point[3] = {static_cast<float>(i), static_cast<float>(k), -1.5f};
      writer.value()->append_floats(point);
    }
    gltf::Primitive primitive;
    primitive.attributes["POSITION"] = writer.value()->end_accessor();
    mesh.primitives.push_back(primitive);
  }
  writer.value()->document().meshes.push_back(mesh);
  EXPECT_FALSE(fs.exists("out/parts-000.bin"));
  const auto bytes = writer.value()->finish();
  ASSERT_TRUE(bytes.ok());
  // 360 + 360 | 360 | 2400 (larger than a part: one of its own) | 360
  EXPECT_EQ(fs.contents("out/parts-000.bin").size(), 720u);
  EXPECT_EQ(fs.contents("out/parts-001.bin").size(), 360u);
  EXPECT_EQ(fs.contents("out/parts-002.bin").size(), 2400u);
  EXPECT_EQ(fs.contents("out/parts-003.bin").size(), 360u);
  EXPECT_EQ(bytes.value(), 3840u + fs.contents("out/parts.gltf").size());

  const auto document = gltf::load_document(fs, "out/parts.gltf");
  ASSERT_TRUE(document.ok()) << document.error().message;
  gltf::BufferFiles files(fs, document.value());
  auto reader = gltf::AccessorReader::open(files, document.value(), 3);
  float last[3];
  ASSERT_TRUE(reader.value().read_floats(199, 1, last).ok());
  EXPECT_EQ(last[0], 199);
  EXPECT_EQ(last[1], 3);
  EXPECT_EQ(last[2], -1.5f);
}

TEST(GltfWriter, SixteenBitIndicesArePaddedSoThatTheNextAccessorIsAligned) {
  MemoryFileSystem fs;
  auto writer = GltfWriter::create(fs, "out", "pad");
  writer.value()->begin_accessor(AccessorKind::kIndex16, 3);
  writer.value()->append_indices(std::vector<uint32_t>{0, 1, 65534});
  writer.value()->end_accessor();
  writer.value()->begin_accessor(AccessorKind::kVec2, 1);
  writer.value()->append_floats(std::vector<float>{1, 2});
  writer.value()->end_accessor();
  EXPECT_EQ(writer.value()->document().views[0].byte_length, 6u);
  EXPECT_EQ(writer.value()->document().views[1].byte_offset, 8u);
}

TEST(GltfWriter, AFullDiskIsAnErrorAndLeavesNothingBehind) {
  for (uint64_t call = 0; call < 6; ++call) {
    MemoryFileSystem memory;
    FaultyFileSystem fs(memory);
    fs.arm(Fault::kDiskFull, call, true);
    auto writer = GltfWriter::create(fs, "out", "full", {.part_bytes = 400, .buffer_bytes = 128});
    if (!writer.ok()) {
      EXPECT_EQ(writer.error().code, ErrorCode::kStorage);
      continue;
    }
    SurfaceWriter surfaces(*writer.value());
    gltf::Mesh mesh;
    surfaces.add_grid(
        mesh, {8, 8}, [](uint64_t i, uint64_t j) { return Vec3(i, j, 0); }, 0);
    const auto finished = writer.value()->finish();
    ASSERT_FALSE(finished.ok());
    EXPECT_EQ(finished.error().code, ErrorCode::kStorage);
    writer.value().reset();
    EXPECT_TRUE(memory.names().empty());
  }
}

/// Every edge of a closed surface is walked once each way, when vertices at one place count as one.
void expect_closed(uint32_t cells) {
  MemoryFileSystem fs;
  auto writer = GltfWriter::create(fs, "out", "sphere");
  gltf::Document& document = writer.value()->document();
  document.materials.emplace_back();
  SurfaceWriter surfaces(*writer.value());
  gltf::Mesh sphere;
  surfaces.add_sphere(
      sphere, cells, [](const DVec3& p) { return Vec3(p * 3.0); }, 0);
  EXPECT_EQ(surfaces.triangles_count(), sphere_triangles(cells));
  document.meshes.push_back(sphere);
  ASSERT_TRUE(writer.value()->finish().ok());
  const auto loaded = gltf::load_document(fs, "out/sphere.gltf");
  ASSERT_TRUE(loaded.ok()) << loaded.error().message;
  gltf::BufferFiles files(fs, loaded.value());
  using Place = std::tuple<float, float, float>;
  std::map<std::pair<Place, Place>, int> edges;
  for (const gltf::Primitive& primitive : loaded.value().meshes[0].primitives) {
    auto reader = gltf::AccessorReader::open(files, loaded.value(), primitive.attributes.at("POSITION"));
    auto stream = gltf::TriangleStream::open(files, loaded.value(), primitive);
    std::vector<float> points(reader.value().count() * 3);
    std::vector<uint32_t> indices(stream.value().count() * 3);
    ASSERT_TRUE(reader.value().read_floats(0, reader.value().count(), points).ok());
    ASSERT_TRUE(stream.value().read(0, stream.value().count(), indices).ok());
    const auto point = [&](uint32_t i) { return Vec3(points[i * 3], points[i * 3 + 1], points[i * 3 + 2]); };
    const auto place = [](const Vec3& p) { return Place(p.x, p.y, p.z); };
    for (size_t t = 0; t < indices.size(); t += 3) {
      Vec3 p[3];
      for (size_t k = 0; k < 3; ++k) p[k] = point(indices[t + k]);
      EXPECT_GT(glm::dot(glm::cross(p[1] - p[0], p[2] - p[0]), p[0]), 0);  // seen from outside
      for (size_t k = 0; k < 3; ++k) ++edges[{place(p[k]), place(p[(k + 1) % 3])}];
    }
  }
  for (const auto& [edge, times] : edges) {
    EXPECT_EQ(times, 1);
    EXPECT_EQ(edges.count({edge.second, edge.first}), 1u);
  }
}

TEST(SurfaceWriter, SpheresAreClosedAndFaceOutwards) {
  expect_closed(1);
  expect_closed(9);
  expect_closed(104);  // in patches, face by face
}

}  // namespace
}  // namespace shoal
