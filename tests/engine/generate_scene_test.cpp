#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "engine/generate.h"
#include "engine/generate_surfaces.h"
#include "io/gltf_accessor.h"
#include "tests/support/memory_file_system.h"

namespace shoal {
namespace {

/// A small source to tile: a strip, a mirrored node, a light, a camera, uv and normals.
void put_tile_source(MemoryFileSystem& fs) {
  const float positions[12] = {0, 0, 0, 2, 0, 0, 0, 1, 0, 2, 1, 0};
  const float uvs[8] = {0, 1, 1, 1, 0, 0, 1, 0};
  const float normals[12] = {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1};
  std::vector<std::byte> bytes;
  for (const auto& values :
       {std::span<const float>(positions), std::span<const float>(uvs), std::span<const float>(normals)}) {
    const auto raw = std::as_bytes(values);
    bytes.insert(bytes.end(), raw.begin(), raw.end());
  }
  fs.put("in/source.bin", bytes);
  fs.put("in/source.gltf", R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1,2]}],
    "extensionsUsed":["KHR_lights_punctual"],
    "extensions":{"KHR_lights_punctual":{"lights":[{"type":"point","intensity":5},{"type":"directional"}]}},
    "nodes":[{"mesh":0,"translation":[0,0,3]},
             {"mesh":0,"scale":[-1,2,1],"extensions":{"KHR_lights_punctual":{"light":0}}},
             {"camera":0,"children":[3]},{"extensions":{"KHR_lights_punctual":{"light":1}}}],
    "cameras":[{"type":"perspective","perspective":{"yfov":0.7,"znear":0.1}}],
    "materials":[{"name":"tiled \"quoted\"","emissiveFactor":[1,0.5,0],
                  "extensions":{"KHR_materials_emissive_strength":{"emissiveStrength":7}}}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1,"NORMAL":2},"mode":5,"material":0}]}],
    "buffers":[{"uri":"source.bin","byteLength":128}],
    "bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":32},
                   {"buffer":0,"byteOffset":80,"byteLength":48}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[2,1,0]},
                 {"bufferView":1,"componentType":5126,"count":4,"type":"VEC2"},
                 {"bufferView":2,"componentType":5126,"count":4,"type":"VEC3"}]})");
}

GenerateOptions options_for(const std::string& kind, uint64_t triangles, uint64_t seed = 1) {
  GenerateOptions options;
  options.kind = kind, options.triangles = triangles, options.out_dir = "out", options.seed = seed;
  if (kind == "tile") options.source = "in/source.gltf";
  return options;
}

struct Counted {
  uint64_t stored = 0, shown = 0;
};

/// Reads every accessor of every primitive: counts triangles, checks ranges and what is stated about POSITION.
Counted read_everything(FileSystem& fs, const std::string& path) {
  Counted counted;
  const auto loaded = gltf::load_document(fs, path);
  EXPECT_TRUE(loaded.ok()) << loaded.error().message;
  if (!loaded.ok()) return counted;
  const gltf::Document& document = loaded.value();
  EXPECT_TRUE(document.warnings.empty()) << document.warnings[0];
  const auto text = read_whole_file(fs, path, 1u << 30);
  const auto json = nlohmann::json::parse(text.value());
  gltf::BufferFiles files(fs, document);
  std::vector<uint64_t> mesh_triangles;
  for (const gltf::Mesh& mesh : document.meshes) {
    uint64_t triangles = 0;
    for (const gltf::Primitive& primitive : mesh.primitives) {
      auto stream = gltf::TriangleStream::open(files, document, primitive);
      EXPECT_TRUE(stream.ok()) << stream.error().message;
      std::vector<uint32_t> indices(stream.value().count() * 3);
      const Status read = stream.value().read(0, stream.value().count(), indices);
      EXPECT_TRUE(read.ok()) << read.error().message;  // out of range fails here
      triangles += stream.value().count();
      for (const auto& [name, accessor] : primitive.attributes) {
        auto reader = gltf::AccessorReader::open(files, document, accessor);
        EXPECT_TRUE(reader.ok()) << reader.error().message;
        const uint32_t components = reader.value().components();
        std::vector<float> values(reader.value().count() * components);
        EXPECT_TRUE(reader.value().read_floats(0, reader.value().count(), values).ok());
        for (const float value : values) EXPECT_TRUE(std::isfinite(value));
        if (name != "POSITION") continue;
        for (uint32_t c = 0; c < 3; ++c) {
          float lo = values[c], hi = values[c];
          for (size_t i = c; i < values.size(); i += 3) lo = std::min(lo, values[i]), hi = std::max(hi, values[i]);
          EXPECT_EQ(json["accessors"][accessor]["min"][c].get<float>(), lo);
          EXPECT_EQ(json["accessors"][accessor]["max"][c].get<float>(), hi);
        }
      }
    }
    mesh_triangles.push_back(triangles);
    counted.stored += triangles;
  }
  for (const gltf::Node& node : document.nodes) counted.shown += node.mesh ? mesh_triangles[*node.mesh] : 0;
  EXPECT_FALSE(document.cameras.empty());
  return counted;
}

class GenerateKind : public testing::TestWithParam<std::string> {
 protected:
  GenerateKind() { put_tile_source(fs_); }
  MemoryFileSystem fs_;
};

TEST_P(GenerateKind, WritesAsManyTrianglesAsAskedAndReportsThem) {
  for (const uint64_t asked : {1000u, 3001u, 20000u, 150000u}) {
    // The demo's count is of what is stored, and its models have a least size.
    const bool demo = GetParam() == "demo";
    if (demo && asked < 100000) continue;
    const auto report = generate_scene(fs_, options_for(GetParam(), asked));
    ASSERT_TRUE(report.ok()) << report.error().message;
    EXPECT_EQ(report.value().gltf_path, "out/" + GetParam() + ".gltf");
    const Counted counted = read_everything(fs_, report.value().gltf_path);
    EXPECT_EQ(counted.stored, report.value().triangles_count);
    EXPECT_EQ(counted.shown, report.value().instanced_triangles_count);
    EXPECT_NEAR(static_cast<double>(demo ? counted.stored : counted.shown), static_cast<double>(asked),
                0.02 * static_cast<double>(asked));
  }
}

TEST_P(GenerateKind, GivesTheSameBytesTwiceAndOthersForAnotherSeed) {
  const auto first = generate_scene(fs_, options_for(GetParam(), 20000));
  ASSERT_TRUE(first.ok());
  std::map<std::string, std::vector<std::byte>> before;
  for (const std::string& name : fs_.names()) before[name] = fs_.contents(name);
  ASSERT_TRUE(generate_scene(fs_, options_for(GetParam(), 20000)).ok());
  for (const std::string& name : fs_.names()) EXPECT_EQ(fs_.contents(name), before[name]) << name;
  ASSERT_TRUE(generate_scene(fs_, options_for(GetParam(), 20000, 2)).ok());
  const std::string part = "out/" + GetParam() + "-000.bin";
  EXPECT_NE(fs_.contents(part), before[part]);
}

TEST_P(GenerateKind, FailsWithUsageForCountsOutOfRange) {
  for (const uint64_t asked : {uint64_t{1}, kMaxGenerateTriangles + 1}) {
    const auto report = generate_scene(fs_, options_for(GetParam(), asked));
    ASSERT_FALSE(report.ok());
    EXPECT_EQ(report.error().code, ErrorCode::kUsage);
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, GenerateKind, testing::Values("terrain", "instances", "tile", "demo"),
                         [](const auto& kind) { return kind.param; });

TEST(Generate, RefusesUnknownKindsAndSourcesThatDoNotFit) {
  MemoryFileSystem fs;
  EXPECT_EQ(generate_scene(fs, options_for("city", 5000)).error().code, ErrorCode::kUsage);
  GenerateOptions terrain = options_for("terrain", 5000);
  terrain.source = "in/source.gltf";
  EXPECT_EQ(generate_scene(fs, terrain).error().code, ErrorCode::kUsage);
  GenerateOptions tile = options_for("tile", 5000);
  tile.source.clear();
  EXPECT_EQ(generate_scene(fs, tile).error().code, ErrorCode::kUsage);
  EXPECT_EQ(generate_scene(fs, options_for("tile", 5000)).error().code, ErrorCode::kInput);  // no such file
  EXPECT_TRUE(fs.names().empty());
}

TEST(GenerateTile, KeepsTheFirstCopyMaterialsCamerasAndLights) {
  MemoryFileSystem fs;
  put_tile_source(fs);
  ASSERT_TRUE(generate_scene(fs, options_for("tile", 1000)).ok());
  const auto source = gltf::load_document(fs, "in/source.gltf");
  const auto loaded = gltf::load_document(fs, "out/tile.gltf");
  ASSERT_TRUE(loaded.ok()) << loaded.error().message;
  const gltf::Document& document = loaded.value();
  EXPECT_EQ(document.meshes.size(), 250u);
  EXPECT_EQ(document.materials[0].name, source.value().materials[0].name);
  EXPECT_EQ(document.materials[0].emissive_strength, 7);
  EXPECT_EQ(document.cameras[0].yfov, 0.7);
  uint64_t points = 0, suns = 0;
  for (const gltf::Node& node : document.nodes) {
    if (node.light) ++(document.lights[*node.light].type == gltf::LightType::kPoint ? points : suns);
  }
  EXPECT_EQ(points, 250u);
  EXPECT_EQ(suns, 1u);

  // Copy 0: the strip's vertices moved by the nodes, the mirrored one wound the other way.
  gltf::BufferFiles files(fs, document);
  const gltf::Primitive& primitive = document.meshes[0].primitives[0];
  auto reader = gltf::AccessorReader::open(files, document, primitive.attributes.at("POSITION"));
  std::vector<float> values(24);
  ASSERT_TRUE(reader.value().read_floats(0, 8, values).ok());
  const std::vector<float> expected = {0, 0, 3, 2, 0, 3, 0, 1, 3, 2, 1, 3, 0, 0, 0, -2, 0, 0, 0, 2, 0, -2, 2, 0};
  EXPECT_EQ(values, expected);
  auto stream = gltf::TriangleStream::open(files, document, primitive);
  std::vector<uint32_t> indices(12);
  ASSERT_TRUE(stream.value().read(0, 4, indices).ok());
  EXPECT_EQ(indices, (std::vector<uint32_t>{0, 1, 2, 1, 3, 2, 4, 6, 5, 5, 6, 7}));
}

TEST(GenerateTile, NoTwoCopiesHaveTheSamePositionsAndNeighboursDoNotOverlap) {
  MemoryFileSystem fs;
  put_tile_source(fs);
  ASSERT_TRUE(generate_scene(fs, options_for("tile", 1000)).ok());
  const auto document = gltf::load_document(fs, "out/tile.gltf");
  gltf::BufferFiles files(fs, document.value());
  struct Footprint {
    float lo_x, hi_x, lo_z, hi_z;
  };
  std::vector<Footprint> footprints;
  for (const gltf::Mesh& mesh : document.value().meshes) {
    Footprint f{1e9f, -1e9f, 1e9f, -1e9f};
    auto reader = gltf::AccessorReader::open(files, document.value(), mesh.primitives[0].attributes.at("POSITION"));
    std::vector<float> values(24);
    ASSERT_TRUE(reader.value().read_floats(0, 8, values).ok());
    for (size_t i = 0; i < 24; i += 3) {
      f.lo_x = std::min(f.lo_x, values[i]), f.hi_x = std::max(f.hi_x, values[i]);
      f.lo_z = std::min(f.lo_z, values[i + 2]), f.hi_z = std::max(f.hi_z, values[i + 2]);
    }
    for (const Footprint& g : footprints) {
      EXPECT_TRUE(f.hi_x < g.lo_x || g.hi_x < f.lo_x || f.hi_z < g.lo_z || g.hi_z < f.lo_z);
    }
    footprints.push_back(f);
  }
}

TEST(GenerateGrid, SizesComeNearTheNumberOfCellsAndTheAspect) {
  for (const uint64_t cells : {1u, 2u, 97u, 5000u, 1234567u}) {
    const GridSize size = grid_of(cells, 0.4);
    const double got = static_cast<double>(size.columns * size.rows);
    EXPECT_NEAR(got, static_cast<double>(cells), 0.02 * static_cast<double>(cells)) << cells;
  }
  const GridSize large = grid_of(1'000'000, 0.25);
  EXPECT_NEAR(static_cast<double>(large.columns) / static_cast<double>(large.rows), 0.25, 0.1);
}

}  // namespace
}  // namespace shoal
