#include "io/gltf_accessor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "tests/io/gltf_scene.h"
#include "tests/support/faulty_file_system.h"

namespace shoal::gltf {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;

struct Loaded {
  MemoryFileSystem fs;
  Document document;
  explicit Loaded(const GltfScene& scene) {
    auto result = load_document(fs, scene.put(fs));
    EXPECT_TRUE(result.ok()) << result.error().message;
    if (result.ok()) document = std::move(result).value();
  }
};

TEST(AccessorReader, ReadsEveryComponentTypeAndScalesNormalizedIntegers) {
  GltfScene scene;
  scene.add_accessor<int8_t>({-128, -127, 0, 127}, "SCALAR", kByte, 4);
  scene.add_accessor<uint8_t>({0, 51, 128, 255}, "SCALAR", kUnsignedByte, 4);
  scene.add_accessor<int16_t>({-32768, -32767, 0, 32767}, "SCALAR", kShort, 4);
  scene.add_accessor<uint16_t>({0, 13107, 32768, 65535}, "SCALAR", kUnsignedShort, 4);
  scene.add_accessor<uint32_t>({0, 1, 16777216, 4294967295u}, "SCALAR", kUnsignedInt, 4);
  scene.add_accessor<float>({-1.5f, 0, 1e-40f, 3e38f}, "SCALAR", kFloat, 4);
  for (uint32_t i = 0; i < 4; ++i) {
    json scaled = scene.root["accessors"][i];
    scaled["normalized"] = true;
    scene.add_accessor(scaled);
  }
  Loaded loaded(scene);
  const auto read = [&](uint32_t accessor) { return read_all(loaded.fs, loaded.document, accessor); };
  EXPECT_THAT(read(0), ElementsAre(-128, -127, 0, 127));
  EXPECT_THAT(read(1), ElementsAre(0, 51, 128, 255));
  EXPECT_THAT(read(2), ElementsAre(-32768, -32767, 0, 32767));
  EXPECT_THAT(read(3), ElementsAre(0, 13107, 32768, 65535));
  EXPECT_THAT(read(4), ElementsAre(0, 1, 16777216, 4294967296.0f));
  EXPECT_THAT(read(5), ElementsAre(-1.5f, 0, 1e-40f, 3e38f));
  EXPECT_THAT(read(6), ElementsAre(-1, -1, 0, 1));
  EXPECT_THAT(read(7), ElementsAre(0, 51 / 255.0f, 128 / 255.0f, 1));
  EXPECT_THAT(read(8), ElementsAre(-1, -1, 0, 1));
  EXPECT_THAT(read(9), ElementsAre(0, 13107 / 65535.0f, 32768 / 65535.0f, 1));
}

TEST(AccessorReader, BlocksThatFollowEachOtherAreReadTogether) {
  GltfScene scene;
  constexpr uint64_t kCount = 600007;  // 37 blocks
  std::vector<float> values(kCount);
  std::iota(values.begin(), values.end(), 0.0f);
  scene.add_accessor(values, "SCALAR", kFloat, kCount);
  Loaded loaded(scene);
  FaultyFileSystem counting(loaded.fs);
  BufferFiles files(counting, loaded.document);
  auto reader = AccessorReader::open(files, loaded.document, 0);
  ASSERT_TRUE(reader.ok());
  std::vector<float> out(kCount);
  const auto reads_of = [&](uint64_t first, uint64_t n) {
    counting.arm(Fault::kShortRead, ~uint64_t{0});
    EXPECT_TRUE(reader.value().read_floats(first, n, out).ok());
    EXPECT_TRUE(std::equal(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(n),
                           values.begin() + static_cast<std::ptrdiff_t>(first)));
    return counting.calls();
  };
  EXPECT_EQ(reads_of(0, kCount), 3u);           // a chunk at a time
  EXPECT_EQ(reads_of(590000, 10000), 0u);       // still there
  EXPECT_EQ(reads_of(100000, 10), 1u);          // one block
  EXPECT_EQ(reads_of(90000, 30000), 2u);        // those before it, those behind it
  EXPECT_EQ(reads_of(90000, 30000), 0u);
  EXPECT_EQ(reads_of(5, 0), 0u);
  std::mt19937 random(3);
  for (int i = 0; i < 200; ++i) {
    const uint64_t first = random() % kCount;
    reads_of(first, random() % (kCount - first));
  }
}

TEST(AccessorReader, ABlockWhoseReadFailedIsReadAgain) {
  GltfScene scene;
  std::vector<float> values(100000);
  std::iota(values.begin(), values.end(), 0.0f);
  scene.add_accessor(values, "SCALAR", kFloat, values.size());
  Loaded loaded(scene);
  FaultyFileSystem fs(loaded.fs);
  BufferFiles files(fs, loaded.document);
  auto reader = AccessorReader::open(files, loaded.document, 0);
  ASSERT_TRUE(reader.ok());
  std::vector<float> out(values.size());
  fs.arm(Fault::kShortRead, 0);
  EXPECT_EQ(reader.value().read_floats(0, values.size(), out).error().code, ErrorCode::kStorage);
  ASSERT_TRUE(reader.value().read_floats(0, values.size(), out).ok());
  EXPECT_EQ(out, values);
}

TEST(AccessorReader, StepsOverInterleavedValues) {
  GltfScene scene;
  const uint32_t view = scene.add_view<float>({1, 2, 3, -1, -2, 4, 5, 6, -3, -4, 7, 8, 9}, 20);
  scene.add_accessor({{"bufferView", view}, {"type", "VEC3"}, {"componentType", kFloat}, {"count", 3}});
  scene.add_accessor(
      {{"bufferView", view}, {"byteOffset", 12}, {"type", "VEC2"}, {"componentType", kFloat}, {"count", 2}});
  Loaded loaded(scene);
  EXPECT_THAT(read_all(loaded.fs, loaded.document, 0), ElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9));
  EXPECT_THAT(read_all(loaded.fs, loaded.document, 1), ElementsAre(-1, -2, -3, -4));
}

TEST(AccessorReader, SkipsThePaddingOfMatrixColumns) {
  GltfScene scene;
  scene.add_accessor<uint8_t>({1, 2, 0, 0, 3, 4, 0, 0}, "MAT2", kUnsignedByte, 1);
  scene.add_accessor<uint16_t>({1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 9, 0}, "MAT3", kUnsignedShort, 1);
  scene.add_accessor<float>({1, 2, 3, 4, 5, 6, 7, 8, 9}, "MAT3", kFloat, 1);
  Loaded loaded(scene);
  EXPECT_THAT(read_all(loaded.fs, loaded.document, 0), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(read_all(loaded.fs, loaded.document, 1), ElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9));
  EXPECT_THAT(read_all(loaded.fs, loaded.document, 2), ElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9));
}

TEST(AccessorReader, GivesZerosWithoutAViewAndThenItsSparseValues) {
  GltfScene scene;
  scene.add_accessor({{"type", "VEC2"}, {"componentType", kFloat}, {"count", 3}});
  const uint32_t indices = scene.add_view<uint8_t>({1}), values = scene.add_view<float>({7, 8});
  scene.add_accessor({{"type", "VEC2"},
                      {"componentType", kFloat},
                      {"count", 3},
                      {"sparse",
                       {{"count", 1},
                        {"indices", {{"bufferView", indices}, {"componentType", kUnsignedByte}}},
                        {"values", {{"bufferView", values}}}}}});
  Loaded loaded(scene);
  EXPECT_THAT(read_all(loaded.fs, loaded.document, 0), ElementsAre(0, 0, 0, 0, 0, 0));
  EXPECT_THAT(read_all(loaded.fs, loaded.document, 1), ElementsAre(0, 0, 7, 8, 0, 0));
}

/// A long interleaved accessor with many sparse values, and what it must read as.
struct LongAccessor {
  static constexpr uint64_t kCount = 300000;  // many blocks, several runs of sparse indices
  GltfScene scene;
  std::vector<float> expected = std::vector<float>(2 * kCount);
  explicit LongAccessor(bool sparse) {
    std::mt19937 random(7);
    std::vector<float> base(3 * kCount);
    for (uint64_t i = 0; i < kCount; ++i) {
      for (uint64_t c = 0; c < 2; ++c)
        expected[2 * i + c] = base[3 * i + c] = static_cast<float>(random() % 100000);
    }
    json accessor = {
        {"bufferView", scene.add_view(base, 12)}, {"type", "VEC2"}, {"componentType", kFloat}, {"count", kCount}};
    if (sparse) accessor["sparse"] = add_sparse(random);
    scene.add_accessor(accessor);
  }
  json add_sparse(std::mt19937& random) {
    std::vector<uint32_t> indices;
    std::vector<float> values;
    for (uint32_t i = 0; i < kCount; i += 1 + random() % (i < kCount / 2 ? 3 : 20000)) {
      indices.push_back(i);
      for (uint64_t c = 0; c < 2; ++c) {
        values.push_back(-static_cast<float>(random() % 1000));
        expected[2 * i + c] = values.back();
      }
    }
    return {{"count", indices.size()},
            {"indices", {{"bufferView", scene.add_view(indices)}, {"componentType", kUnsignedInt}}},
            {"values", {{"bufferView", scene.add_view(values)}}}};
  }
};

TEST(AccessorReader, ReadsRunsInAnyOrderAsTheWhole) {
  for (const bool sparse : {false, true}) {
    const LongAccessor source(sparse);
    Loaded loaded(source.scene);
    ASSERT_EQ(read_all(loaded.fs, loaded.document, 0), source.expected);
    BufferFiles files(loaded.fs, loaded.document);
    auto reader = AccessorReader::open(files, loaded.document, 0);
    ASSERT_TRUE(reader.ok());
    std::mt19937 random(sparse);
    std::vector<float> run;
    for (int i = 0; i < 300; ++i) {
      const uint64_t first = random() % LongAccessor::kCount;
      const uint64_t n = std::min<uint64_t>(random() % (i % 10 == 0 ? 50000 : 50), LongAccessor::kCount - first);
      run.assign(2 * n, 0.0f);
      ASSERT_TRUE(reader.value().read_floats(first, n, run).ok());
      ASSERT_TRUE(std::equal(run.begin(), run.end(), source.expected.begin() + static_cast<ptrdiff_t>(2 * first)));
    }
  }
}

TEST(AccessorReader, ReadsEachByteOnceWhenElementsAreAskedOneByOne) {
  const LongAccessor source(false);
  Loaded loaded(source.scene);
  BufferFiles files(loaded.fs, loaded.document);
  auto reader = AccessorReader::open(files, loaded.document, 0);
  ASSERT_TRUE(reader.ok());
  std::array<float, 2> value;
  for (uint64_t i = 0; i < LongAccessor::kCount; ++i) ASSERT_TRUE(reader.value().read_floats(i, 1, value).ok());
  EXPECT_LE(files.read_bytes(), 12 * LongAccessor::kCount);
  EXPECT_FALSE(reader.value().read_floats(LongAccessor::kCount, 1, value).ok());
  EXPECT_FALSE(reader.value().read_floats(~0ull, 1, value).ok());
}

TEST(AccessorReader, RefusesSparseIndicesThatAreNotIncreasingOrOutOfRange) {
  for (const std::vector<uint16_t>& indices : {std::vector<uint16_t>{1, 1}, {2, 1}, {0, 3}, {3, 65535}}) {
    GltfScene scene;
    const uint32_t index_view = scene.add_view(indices), value_view = scene.add_view<float>({1, 2});
    scene.add_accessor({{"type", "SCALAR"},
                        {"componentType", kFloat},
                        {"count", 3},
                        {"sparse",
                         {{"count", 2},
                          {"indices", {{"bufferView", index_view}, {"componentType", kUnsignedShort}}},
                          {"values", {{"bufferView", value_view}}}}}});
    Loaded loaded(scene);
    BufferFiles files(loaded.fs, loaded.document);
    const auto reader = AccessorReader::open(files, loaded.document, 0);
    ASSERT_FALSE(reader.ok());
    EXPECT_EQ(reader.error().code, ErrorCode::kInput);
    EXPECT_THAT(reader.error().message, HasSubstr("accessors[0]: sparse index"));
  }
}

TEST(AccessorReader, RefusesABufferFileThatIsShorterThanItSays) {
  const GltfScene scene = triangle_scene();
  MemoryFileSystem fs;
  const auto document = load_document(fs, scene.put(fs));
  ASSERT_TRUE(document.ok());
  fs.put("dir/scene.bin", std::vector<std::byte>(10));
  BufferFiles files(fs, document.value());
  const auto reader = AccessorReader::open(files, document.value(), 0);
  ASSERT_FALSE(reader.ok());
  EXPECT_EQ(reader.error().code, ErrorCode::kInput);
  EXPECT_THAT(reader.error().message, HasSubstr("buffers[0].byteLength"));
}

TEST(BufferFiles, ReopenBuffersWhenThereAreMoreThanMayBeOpen) {
  GltfScene scene;
  MemoryFileSystem fs;
  const uint32_t count = BufferFiles::kMaxOpenFiles + 10;
  for (uint32_t i = 0; i < count; ++i) {
    const std::string name = "part" + std::to_string(i) + ".bin";
    fs.put("dir/" + name, std::vector<std::byte>{static_cast<std::byte>(i)});
    scene.root["buffers"].push_back({{"uri", name}, {"byteLength", 1}});
  }
  const auto document = load_document(fs, scene.put(fs));
  ASSERT_TRUE(document.ok()) << document.error().message;
  BufferFiles files(fs, document.value());
  for (uint32_t i = 0; i < 3 * count; ++i) {
    std::byte byte;
    ASSERT_TRUE(files.read(i % count, 0, std::span(&byte, 1)).ok());
    ASSERT_EQ(byte, static_cast<std::byte>(i % count));
  }
}

GltfScene scene_of_mode(int mode, const std::vector<uint16_t>& indices, uint64_t vertex_count) {
  GltfScene scene;
  json primitive = {
      {"attributes",
       {{"POSITION", scene.add_accessor(std::vector<float>(3 * vertex_count), "VEC3", kFloat, vertex_count)}}},
      {"mode", mode}};
  if (!indices.empty()) {
    primitive["indices"] = scene.add_accessor(indices, "SCALAR", kUnsignedShort, indices.size());
  }
  scene.add_mesh(primitive);
  return scene;
}

std::vector<uint32_t> triangles_of(const GltfScene& scene) {
  Loaded loaded(scene);
  return read_triangles(loaded.fs, loaded.document);
}

TEST(TriangleStream, UndoesListsStripsAndFansWithAndWithoutIndices) {
  EXPECT_THAT(triangles_of(scene_of_mode(4, {}, 7)), ElementsAre(0, 1, 2, 3, 4, 5));
  EXPECT_THAT(triangles_of(scene_of_mode(4, {4, 3, 2, 1, 0, 1}, 5)), ElementsAre(4, 3, 2, 1, 0, 1));
  EXPECT_THAT(triangles_of(scene_of_mode(5, {}, 5)), ElementsAre(0, 1, 2, 1, 3, 2, 2, 3, 4));
  EXPECT_THAT(triangles_of(scene_of_mode(5, {9, 8, 7, 6}, 10)), ElementsAre(9, 8, 7, 8, 6, 7));
  EXPECT_THAT(triangles_of(scene_of_mode(6, {}, 5)), ElementsAre(1, 2, 0, 2, 3, 0, 3, 4, 0));
  EXPECT_THAT(triangles_of(scene_of_mode(6, {9, 8, 7, 6}, 10)), ElementsAre(8, 7, 9, 7, 6, 9));
}

TEST(TriangleStream, HasNoTrianglesInPointsLinesAndShortRuns) {
  for (const int mode : {0, 1, 2, 3}) EXPECT_TRUE(triangles_of(scene_of_mode(mode, {}, 9)).empty());
  for (const int mode : {4, 5, 6}) EXPECT_TRUE(triangles_of(scene_of_mode(mode, {}, 2)).empty());
}

TEST(TriangleStream, ReadsPiecesAsTheWhole) {
  std::mt19937 random(3);
  std::vector<uint16_t> indices(5000);
  for (auto& index : indices) index = static_cast<uint16_t>(random() % 2000);
  for (const int mode : {4, 5, 6}) {
    Loaded loaded(scene_of_mode(mode, indices, 2000));
    const std::vector<uint32_t> whole = read_triangles(loaded.fs, loaded.document);
    BufferFiles files(loaded.fs, loaded.document);
    auto stream = TriangleStream::open(files, loaded.document, loaded.document.meshes[0].primitives[0]);
    ASSERT_TRUE(stream.ok());
    std::vector<uint32_t> pieces;
    for (uint64_t first = 0; first < stream.value().count();) {
      const uint64_t n = std::min<uint64_t>(1 + random() % 1500, stream.value().count() - first);
      std::vector<uint32_t> piece(3 * n);
      ASSERT_TRUE(stream.value().read(first, n, piece).ok());
      pieces.insert(pieces.end(), piece.begin(), piece.end());
      first += n;
    }
    EXPECT_EQ(pieces, whole);
  }
}

TEST(TriangleStream, RefusesIndicesOutOfRangeAndPrimitiveRestart) {
  for (const auto& [index, vertex_count] : {std::pair{5, 5u}, {65535, 5u}, {65535, 70000u}}) {
    Loaded loaded(scene_of_mode(4, {0, 1, static_cast<uint16_t>(index)}, vertex_count));
    BufferFiles files(loaded.fs, loaded.document);
    auto stream = TriangleStream::open(files, loaded.document, loaded.document.meshes[0].primitives[0]);
    ASSERT_TRUE(stream.ok());
    std::array<uint32_t, 3> corners;
    const Status status = stream.value().read(0, 1, corners);
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(status.error().code, ErrorCode::kInput);
    EXPECT_THAT(status.error().message, HasSubstr("accessors[1]: index 2: expected a vertex below"));
  }
}

}  // namespace
}  // namespace shoal::gltf
