// Building out of core gives what building at once gives: the same triangles, emitters and pictures to the bit, and a
// tree that costs the same.
#include "engine/build_chunks.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "engine/generate.h"
#include "engine/render.h"
#include "tests/engine/built_scene.h"
#include "tests/support/faulty_file_system.h"
#include "tests/support/sample_soups.h"
#include "tests/support/temporary_folder.h"

namespace shoal::testing {
namespace {

SceneBuildOptions in_chunks_of(uint64_t triangles) {
  SceneBuildOptions options;
  options.chunk_triangles = triangles;
  return options;
}

void expect_same_triangles(const BuiltScene& a, const BuiltScene& b) {
  EXPECT_EQ(a.report.triangles_count, b.report.triangles_count);
  EXPECT_EQ(a.report.degenerate_count, b.report.degenerate_count);
  EXPECT_EQ(a.report.warnings, b.report.warnings);
  ASSERT_EQ(a.objects.size(), b.objects.size());
  for (size_t o = 0; o < a.objects.size(); ++o) {
    ASSERT_EQ(a.objects[o].size(), b.objects[o].size());
    for (size_t i = 0; i < a.objects[o].size(); ++i) {
      const ReadTriangle &x = a.objects[o][i], &y = b.objects[o][i];
      ASSERT_EQ(x.primitive, y.primitive);
      EXPECT_EQ(x.material, y.material);
      EXPECT_EQ(std::memcmp(x.position, y.position, sizeof x.position), 0) << "primitive " << x.primitive;
      EXPECT_EQ(std::memcmp(x.corner, y.corner, sizeof x.corner), 0) << "primitive " << x.primitive;
      EXPECT_EQ(x.coverage.has_value(), y.coverage.has_value());
      EXPECT_EQ(x.texels, y.texels);
    }
  }
  ASSERT_EQ(a.scene.emitters.size(), b.scene.emitters.size());
  if (a.scene.emitters.empty()) return;
  EXPECT_EQ(std::memcmp(a.scene.emitters.data(), b.scene.emitters.data(),
                        a.scene.emitters.size() * sizeof(a.scene.emitters[0])),
            0);
}

/// A soup as scene.gltf with 32-bit floats and no indices.
void save(MemoryFileSystem& fs, const TriangleSoup& soup) {
  WrittenScene scene;
  const uint32_t positions = scene.add_floats(3, soup.positions);
  scene.add_node({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", positions}}}})}});
  scene.save(fs);
}

TEST(BuildChunks, HoldTheTrianglesOfASoup) {
  MemoryFileSystem fs;
  save(fs, random_soup(20000, 0.02f));
  const BuiltScene whole = build_and_open(fs);
  for (const uint64_t triangles : {300u, 7000u, 19999u}) {
    const BuiltScene chunked = build_and_open(fs, in_chunks_of(triangles));
    expect_same_triangles(whole, chunked);
    EXPECT_GT(chunked.report.chunks_count, 1u);
    EXPECT_LE(chunked.report.sah_cost, 1.05 * whole.report.sah_cost) << triangles;
  }
  EXPECT_EQ(whole.report.chunks_count, 0u);
  EXPECT_EQ(build_and_open(fs, in_chunks_of(20000)).report.chunks_count, 0u);
}

TEST(BuildChunks, CutADenseClusterAgain) {
  MemoryFileSystem fs;
  TriangleSoup soup = random_soup(6000, 0.01f);
  for (size_t i = 0; i < soup.positions.size(); ++i) soup.positions[i] *= i < 27000 ? 1e-5f : 1e-9f;
  add_triangle(soup, {0, 0, 0}, {100, 0, 0}, {0, 100, 0});  // two teapots in a stadium
  add_triangle(soup, {5000, 5000, 5000}, {5100, 5000, 5000}, {5000, 5100, 5000});
  save(fs, soup);
  const BuiltScene whole = build_and_open(fs);
  const BuiltScene chunked = build_and_open(fs, in_chunks_of(500));
  expect_same_triangles(whole, chunked);
  EXPECT_LE(chunked.report.sah_cost, 1.05 * whole.report.sah_cost);
  EXPECT_GT(chunked.report.scratch_written_bytes, 6000u * 44) << "some chunk was written twice";
}

TEST(BuildChunks, DivideTrianglesInOnePlaceByTheirOrder) {
  MemoryFileSystem fs;
  TriangleSoup soup;
  for (int i = 0; i < 3000; ++i) add_triangle(soup, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  save(fs, soup);
  const BuiltScene whole = build_and_open(fs);
  expect_same_triangles(whole, build_and_open(fs, in_chunks_of(100)));
  soup = random_soup(300, 0.01f);  // and beside others
  for (int i = 0; i < 3000; ++i) add_triangle(soup, {7, 7, 7}, {8, 7, 7}, {7, 8, 7});
  save(fs, soup);
  expect_same_triangles(build_and_open(fs), build_and_open(fs, in_chunks_of(100)));
}

TEST(BuildChunks, CountDegenerateTrianglesAsAtOnce) {
  MemoryFileSystem fs;
  TriangleSoup soup = random_soup(3000, 0.02f);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (size_t i = 0; i < soup.size(); i += 7) soup.positions[9 * i + 4] = i % 2 ? nan : 1e38f;
  for (size_t i = 3; i < soup.size(); i += 11) std::copy_n(&soup.positions[9 * i], 3, &soup.positions[9 * i + 6]);
  save(fs, soup);
  const BuiltScene whole = build_and_open(fs);
  EXPECT_GT(whole.report.degenerate_count, 500u);
  expect_same_triangles(whole, build_and_open(fs, in_chunks_of(200)));
}

TEST(BuildChunks, NothingButDegenerateTrianglesIsNoScene) {
  MemoryFileSystem fs;
  TriangleSoup soup;
  for (int i = 0; i < 1000; ++i) add_triangle(soup, {0, 0, 0}, {0, 0, 0}, {0, 1, 0});
  save(fs, soup);
  EXPECT_EQ(build_error(fs, ErrorCode::kInput), build_error(fs, ErrorCode::kInput, in_chunks_of(10)));
  soup = {};
  for (int i = 0; i < 1000; ++i) add_triangle(soup, {0, 0, 0}, {3e38f, 0, 0}, {0, 3e38f, 0});
  save(fs, soup);
  EXPECT_EQ(build_error(fs, ErrorCode::kInput), build_error(fs, ErrorCode::kInput, in_chunks_of(10)));
}

TEST(BuildChunks, KeepAttributesMaterialsCoverageAndEmitters) {
  MemoryFileSystem fs;
  WrittenScene scene;
  std::vector<uint8_t> leaf;
  for (uint32_t i = 0; i < 64 * 64; ++i) leaf.insert(leaf.end(), {200, 100, 50, uint8_t(i % 5 ? 255 : i % 256)});
  const uint32_t alpha = scene.add_texture(fs, 64, 64, leaf);
  scene.json["materials"] = {
      {{"name", "leaf"}, {"alphaMode", "MASK"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", alpha}}}}}},
      {{"name", "lamp"}, {"emissiveFactor", {1, 2, 3}}, {"emissiveTexture", {{"index", alpha}}}},
      {{"name", "plain"}}};
  for (int mesh = 0; mesh < 6; ++mesh) {
    const TriangleSoup soup = random_soup(500, 0.05f, static_cast<uint64_t>(mesh) + 1);
    Numbers numbers(static_cast<uint64_t>(mesh) + 99);
    std::vector<float> uv, normals;
    for (size_t i = 0; i < 3 * soup.size(); ++i) uv.insert(uv.end(), {numbers.uniform(0, 1), numbers.uniform(0, 1)});
    for (size_t i = 0; i < 3 * soup.size(); ++i) normals.insert(normals.end(), {numbers.uniform(0, 1), 1, 0});
    nlohmann::json attributes = {{"POSITION", scene.add_floats(3, soup.positions)},
                                 {"TEXCOORD_0", scene.add_floats(2, uv)}};
    if (mesh % 2) attributes["NORMAL"] = scene.add_floats(3, normals);
    const uint32_t index = scene.add_mesh({{"attributes", attributes}, {"material", mesh % 3}});
    scene.add_node({{"mesh", index}, {"translation", {mesh, 0, 0}}});
    if (mesh > 3) scene.add_node({{"mesh", index}, {"scale", {-2, 1, 1}}});  // instanced
  }
  scene.save(fs);
  const BuiltScene whole = build_and_open(fs);
  ASSERT_GT(whole.scene.emitters.size(), 1000u);
  ASSERT_EQ(whole.objects.size(), 3u);
  for (const uint64_t triangles : {60u, 450u, 1999u}) {
    expect_same_triangles(whole, build_and_open(fs, in_chunks_of(triangles)));
  }
}

TEST(BuildChunks, GiveTheSameBytesOnAnyNumberOfThreads) {
  MemoryFileSystem fs;
  save(fs, random_soup(30000, 0.02f));
  SceneBuildOptions options = in_chunks_of(2000);
  std::vector<std::byte> first;
  for (const unsigned threads : {1u, 4u}) {
    const tbb::global_control more(tbb::global_control::max_allowed_parallelism, 4);
    options.threads = threads;
    const auto report = build_scene(fs, "scene.gltf", "scene.shoal", options);
    ASSERT_TRUE(report.ok()) << report.error().message;
    const std::vector<std::byte> bytes = fs.contents("scene.shoal");
    if (first.empty()) first = bytes;
    EXPECT_EQ(first == bytes, true) << threads;
  }
}

TEST(BuildChunks, LeaveNothingWhenStoppedInAnyStage) {
  MemoryFileSystem fs;
  TriangleSoup soup = random_soup(40000, 0.01f);
  save(fs, soup);
  const std::vector<std::string> before = fs.names();
  for (const char* stage : {"measuring", "counting", "sorting", "building"}) {
    std::atomic<bool> stop = false;
    SceneBuildOptions options = in_chunks_of(3000);
    options.stop = &stop;
    bool reached = false;
    options.progress = [&](const BuildProgress& p) {
      if (p.stage == std::string(stage)) stop = reached = true;
    };
    const auto report = build_scene(fs, "scene.gltf", "scene.shoal", options);
    EXPECT_TRUE(reached) << stage;
    ASSERT_FALSE(report.ok()) << stage;
    EXPECT_EQ(report.error().code, ErrorCode::kStopped) << stage;
    EXPECT_EQ(fs.names(), before) << stage;
  }
}

TEST(BuildChunks, ReportEveryFailureOfTheDisk) {
  MemoryFileSystem memory;
  save(memory, random_soup(8000, 0.02f));
  const std::vector<std::string> before = memory.names();
  FaultyFileSystem fs(memory);
  fs.arm(Fault::kNone, 0);
  uint64_t calls = 0;
  for (const Fault fault : {Fault::kIoError, Fault::kDiskFull}) {
    fs.arm(fault, ~0ull);
    ASSERT_TRUE(build_scene(fs, "scene.gltf", "scene.shoal", in_chunks_of(900)).ok());
    calls = fs.calls();
    ASSERT_TRUE(memory.remove("scene.shoal").ok());
    for (uint64_t call = 0; call < calls; call += 1 + calls / 60) {
      fs.arm(fault, call, true);
      const auto report = build_scene(fs, "scene.gltf", "scene.shoal", in_chunks_of(900));
      EXPECT_FALSE(report.ok()) << call;
      EXPECT_EQ(memory.names(), before) << call;
    }
  }
}

TEST(BuildChunks, RefuseATinyCapAndWorkWithTheOneNamed) {
  MemoryFileSystem fs;
  save(fs, random_soup(100000, 0.01f));
  SceneBuildOptions options;
  options.max_memory_bytes = 1 << 20;
  const std::string message = build_error(fs, ErrorCode::kMemoryCap, options);
  const uint64_t mib = std::stoull(message.substr(message.find("needs ") + 6));
  options.max_memory_bytes = mib << 20;
  uint64_t planned = 0;
  options.planned = [&](const BuildMemoryPlan& plan) { planned = plan.cap_bytes; };
  const BuiltScene built = build_and_open(fs, options);
  EXPECT_EQ(planned, mib << 20);
  EXPECT_GT(built.report.chunks_count, 1u);
  EXPECT_EQ(built.report.triangles_count, 100000u);
}

/// The path of its glTF.
std::string terrain_of(uint64_t triangles, const std::string& out_dir) {
  GenerateOptions terrain;
  terrain.kind = "terrain";
  terrain.triangles = triangles;
  terrain.out_dir = out_dir;
  const auto generated = generate_scene(posix_file_system(), terrain);
  EXPECT_TRUE(generated.ok()) << generated.error().message;
  return generated.ok() ? generated.value().gltf_path : "";
}

TEST(BuildChunks, ConsumeThePartsOfTheSourceAndNothingElse) {
  const TemporaryFolder folder;
  const std::string gltf = terrain_of(60000, folder / "terrain"), part = folder / "terrain/terrain-000.bin";
  const auto size = std::filesystem::file_size(part);
  const BuiltScene whole = build_and_open(posix_file_system(), {}, gltf, folder / "whole.shoal");
  SceneBuildOptions options = in_chunks_of(9000);
  options.consume = true;
  std::filesystem::create_hard_link(part, folder / "second name");
  const auto kept = build_scene(posix_file_system(), gltf, folder / "kept.shoal", options);
  ASSERT_TRUE(kept.ok()) << kept.error().message;
  EXPECT_EQ(kept.value().consumed_bytes, 0u);
  EXPECT_EQ(kept.value().warnings.size(), whole.report.warnings.size() + 1) << "the part has another name";
  std::filesystem::remove(folder / "second name");
  const BuiltScene consumed = build_and_open(posix_file_system(), options, gltf, folder / "consumed.shoal");
  expect_same_triangles(whole, consumed);
  EXPECT_GT(std::filesystem::file_size(gltf), 0u);
  EXPECT_EQ(std::filesystem::file_size(part), size);
  if (consumed.report.consumed_bytes == 0) GTEST_SKIP() << "this file system has no holes";
  EXPECT_GE(consumed.report.consumed_bytes, size - 4096);
}

/// The glTF with everything twice: the second time its part goes by another name.
void show_part_by_second_name(const std::string& gltf, const std::string& name) {
  std::ifstream in(gltf);
  auto json = nlohmann::json::parse(in);
  in.close();
  const size_t buffers = json["buffers"].size(), views = json["bufferViews"].size();
  const size_t accessors = json["accessors"].size(), meshes = json["meshes"].size(), nodes = json["nodes"].size();
  const auto twice = [&](const char* array, const std::function<void(nlohmann::json&)>& change) {
    const size_t count = json[array].size();
    for (size_t i = 0; i < count; ++i) {
      nlohmann::json copy = json[array][i];
      change(copy);
      json[array].push_back(std::move(copy));
    }
  };
  twice("buffers", [&](auto& buffer) { buffer["uri"] = name + buffer["uri"].template get<std::string>(); });
  twice("bufferViews", [&](auto& view) { view["buffer"] = view["buffer"].template get<size_t>() + buffers; });
  twice("accessors", [&](auto& a) { a["bufferView"] = a["bufferView"].template get<size_t>() + views; });
  twice("meshes", [&](auto& mesh) {
    for (auto& primitive : mesh["primitives"]) {
      for (auto& accessor : primitive["attributes"]) accessor = accessor.template get<size_t>() + accessors;
      if (primitive.contains("indices")) primitive["indices"] = primitive["indices"].template get<size_t>() + accessors;
    }
  });
  twice("nodes", [&](auto& node) {
    if (node.contains("mesh")) node["mesh"] = node["mesh"].template get<size_t>() + meshes;
    if (node.contains("children")) node.erase("children");
  });
  for (size_t i = 0; i < nodes; ++i) json["scenes"][0]["nodes"].push_back(nodes + i);
  std::ofstream(gltf) << json.dump();
}

void consume_part_of_two_names(const std::string& name, SceneBuildOptions options) {
  const TemporaryFolder folder;
  const std::string gltf = terrain_of(30000, folder / "terrain");
  std::filesystem::create_directory_symlink(".", folder / "terrain/link");
  show_part_by_second_name(gltf, name);
  const BuiltScene whole = build_and_open(posix_file_system(), {}, gltf, folder / "whole.shoal");
  options.consume = true;
  const BuiltScene consumed = build_and_open(posix_file_system(), options, gltf, folder / "consumed.shoal");
  EXPECT_GT(whole.report.triangles_count, 2 * 29000u);
  expect_same_triangles(whole, consumed);
}

TEST(BuildChunks, ConsumeAPartOfTwoNamesOnlyWhenItIsReadByBoth) {
  for (const char* name : {"./", "link/"}) {
    consume_part_of_two_names(name, {});
    consume_part_of_two_names(name, in_chunks_of(9000));
  }
}

TEST(BuildChunks, RefuseToConsumeAGlb) {
  MemoryFileSystem fs;
  WrittenScene scene;
  scene.add_node({{"mesh", scene.add_triangle_mesh(0, 1)}});
  scene.save(fs);
  const std::vector<std::byte> json = fs.contents("scene.gltf"), binary = fs.contents("scene.bin");
  nlohmann::json document = nlohmann::json::parse(reinterpret_cast<const char*>(json.data()),
                                                  reinterpret_cast<const char*>(json.data() + json.size()));
  document["buffers"][0].erase("uri");
  std::string text = document.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  std::string glb;
  const auto word = [&glb](uint32_t value) { glb.append(reinterpret_cast<const char*>(&value), 4); };
  word(0x46546c67), word(2), word(static_cast<uint32_t>(28 + text.size() + binary.size()));
  word(static_cast<uint32_t>(text.size())), word(0x4e4f534a);
  glb += text;
  word(static_cast<uint32_t>(binary.size())), word(0x004e4942);
  glb.append(reinterpret_cast<const char*>(binary.data()), binary.size());
  fs.put("scene.glb", glb);
  SceneBuildOptions options;
  ASSERT_TRUE(build_scene(fs, "scene.glb", "scene.shoal", options).ok());
  options.consume = true;
  const auto refused = build_scene(fs, "scene.glb", "other.shoal", options);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kUsage);
  EXPECT_FALSE(fs.exists("other.shoal"));
}

struct Rendered {
  std::vector<float> rgba;
  uint64_t visits = 0;
  SceneBuildReport report;
};

Rendered render_built(const std::string& gltf, const std::string& output, const SceneBuildOptions& options, float sky) {
  FileSystem& fs = posix_file_system();
  auto report = build_scene(fs, gltf, output, options);
  EXPECT_TRUE(report.ok()) << report.error().message;
  const auto scene = open_scene(fs, output, ReadMode::kBuffered, {});
  EXPECT_TRUE(scene.ok()) << scene.error().message;
  PictureOptions picture;
  picture.width = 64, picture.height = 48, picture.samples = 2;
  picture.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(sky), {}};
  ExecutionOptions execution;
  execution.threads = 2;
  const auto result = render(fs, scene.value(), picture, execution);
  EXPECT_TRUE(result.ok()) << result.error().message;
  return {result.value().rgba, result.value().counters.treelet_visits_count, std::move(report).value()};
}

/// `chunk` triangles at once give the same picture, and about the same tree.
void expect_same_picture(const std::string& gltf, uint64_t chunk, float sky) {
  const TemporaryFolder folder;
  SceneBuildOptions options;
  options.treelet_bytes = 64u << 10;
  const Rendered whole = render_built(gltf, folder / "whole.shoal", options, sky);
  options.chunk_triangles = chunk;
  const Rendered chunked = render_built(gltf, folder / "chunked.shoal", options, sky);
  EXPECT_GT(chunked.report.chunks_count, 1u);
  ASSERT_EQ(whole.rgba.size(), chunked.rgba.size());
  EXPECT_EQ(std::memcmp(whole.rgba.data(), chunked.rgba.data(), whole.rgba.size() * sizeof(float)), 0);
  EXPECT_LE(chunked.report.sah_cost, 1.05 * whole.report.sah_cost);
  EXPECT_LE(static_cast<double>(chunked.visits), 1.05 * static_cast<double>(whole.visits));
  EXPECT_EQ(chunked.report.degenerate_count, whole.report.degenerate_count);
}

std::string generated(const TemporaryFolder& folder, const std::string& kind, uint64_t triangles) {
  GenerateOptions options;
  options.kind = kind;
  options.triangles = triangles;
  options.out_dir = folder / kind;
  const auto report = generate_scene(posix_file_system(), options);
  EXPECT_TRUE(report.ok()) << report.error().message;
  return report.value().gltf_path;
}

TEST(BuildChunks, GiveThePictureOfTerrainBuiltAtOnce) {
  const TemporaryFolder folder;
  expect_same_picture(generated(folder, "terrain", 200000), 15000, 0);
}

TEST(BuildChunks, GiveThePictureOfInstancesBuiltAtOnce) {
  const TemporaryFolder folder;
  expect_same_picture(generated(folder, "instances", 300000), 2000, 0.5f);
}

TEST(BuildChunks, GiveThePictureOfTheDemoBuiltAtOnce) {
  const TemporaryFolder folder;
  expect_same_picture(generated(folder, "demo", 100000), 8000, 0);
}

TEST(BuildChunks, GiveThePictureOfTheKitchenBuiltAtOnce) {
  const char* data = std::getenv("SHOAL_DATA");
  if (data == nullptr) GTEST_SKIP() << "SHOAL_DATA is not set";
  expect_same_picture(std::string(data) + "/scenes/kitchen/kitchen.gltf", 100000, 0);
}

}  // namespace
}  // namespace shoal::testing
