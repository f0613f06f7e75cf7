// Exit codes 3 and 4: input that is missing, broken or asks for what is not supported ends with one sentence that
// names the file and the place, and leaves nothing behind.
#include <algorithm>
#include <filesystem>
#include <functional>

#include "tests/bins/small_scene.h"

namespace shoal::testing {
namespace {

/// Both ways into a glTF fail alike, and neither leaves a file.
void expect_refused(const TemporaryFolder& folder, const std::string& scene, int exit_code,
                    const std::vector<std::string>& parts) {
  const std::vector<std::string> before = folder.names();
  expect_error(run_shoal(folder, {"build", scene, "-o", folder / "out.shoal", "--quiet"}), exit_code, parts);
  expect_error(run_shoal(folder, join({"render", scene, "-o", folder / "out.exr", "--quiet", "--cache-dir",
                                       folder / "cache"},
                                      tiny_picture())),
               exit_code, parts);
  if (std::filesystem::exists(folder / "cache")) {
    EXPECT_THAT(folder.names("cache"), ::testing::IsEmpty());
    std::filesystem::remove(folder / "cache");
  }
  EXPECT_EQ(folder.names(), before);
}

TEST(HostileInput, MissingFilesAndFoldersAreNamed) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "folder.gltf");
  expect_refused(folder, folder / "missing.gltf", 3, {"missing.gltf", "No such file"});
  expect_refused(folder, folder / "folder.gltf", 3, {"folder.gltf", "a directory"});
  for (const char* command : {"info", "verify"}) {
    expect_error(run_shoal(folder, {command, folder / "missing.shoal"}), 3, {"missing.shoal", "No such file"});
    expect_error(run_shoal(folder, {command, folder / "folder.gltf"}), 3, {"folder.gltf", "a directory"});
  }
  expect_error(run_shoal(folder, {"diff", folder / "a.exr", folder / "b.exr"}), 3, {"a.exr", "No such file"});
}

TEST(HostileInput, EmptyCutAndGarbageFilesAreRefusedWithTheirPlace) {
  const TemporaryFolder folder;
  save(one_triangle(), folder / "good");
  const std::string json = file_text(folder / "good/scene.gltf");
  std::string garbage;
  for (uint32_t i = 0, x = 1; i < 4096; ++i) garbage += static_cast<char>((x = x * 1664525 + 1013904223) >> 24);
  const std::string glb = std::string("glTF\x02\0\0\0\x40\0\0\0\x20\0\0\0JSON", 20);
  const std::vector<std::pair<std::string, std::string>> files = {
      {"empty.gltf", ""},
      {"empty.glb", ""},
      {"cut.gltf", json.substr(0, json.size() / 2)},
      {"garbage.gltf", garbage},
      {"garbage.glb", garbage},
      {"cut.glb", glb},
      {"header.glb", glb.substr(0, 8)},
      {"version.glb", std::string("glTF\x63\0\0\0\x0c\0\0\0", 12)},
  };
  for (const auto& [name, bytes] : files) {
    put_file(folder / name, bytes);
    expect_refused(folder, folder / name, 3, {name, "expected"});
  }
  put_file(folder / "sky.hdr", garbage);
  expect_error(run_shoal(folder, {"info", folder / "garbage.gltf"}), 3, {"garbage.gltf", "not a .shoal file"});
  expect_error(run_shoal(folder, {"diff", folder / "garbage.gltf", folder / "empty.glb"}), 3, {"garbage.gltf"});
  expect_error(run_shoal(folder, join({"render", folder / "good/scene.gltf", "-o", folder / "o.exr", "--quiet",
                                       "--environment", folder / "sky.hdr"},
                                      tiny_picture())),
               3, {"sky.hdr"});
  EXPECT_FALSE(std::filesystem::exists(folder / "o.exr"));
}

TEST(HostileInput, MissingAndCutBuffersAreNamed) {
  const TemporaryFolder folder;
  save(one_triangle(), folder / "scene");
  const std::string bytes = file_text(folder / "scene/scene.bin");
  put_file(folder / "scene/scene.bin", bytes.substr(0, bytes.size() - 1));
  expect_refused(folder, folder / "scene/scene.gltf", 3, {"buffers[0].byteLength", "scene.bin", "35", "36"});
  std::filesystem::remove(folder / "scene/scene.bin");
  expect_refused(folder, folder / "scene/scene.gltf", 3, {"scene.bin", "No such file"});
}

TEST(HostileInput, AddressesOutsideTheFolderAreRefused) {
  const TemporaryFolder folder;
  save(one_triangle(), folder / "outside");
  std::string json = file_text(folder / "outside/scene.gltf");
  const std::string name = "\"scene.bin\"";
  ASSERT_NE(json.find(name), std::string::npos);
  for (const std::string& uri : {std::string("../outside/scene.bin"), folder / "outside/scene.bin",
                                 std::string("%2e%2e/outside/scene.bin"), std::string("http://host/scene.bin")}) {
    std::string hostile = json;
    hostile.replace(hostile.find(name), name.size(), '"' + uri + '"');
    put_file(folder / "inside/scene.gltf", hostile);
    expect_refused(folder, folder / "inside/scene.gltf", 3, {"inside/scene.gltf", "buffers[0].uri"});
  }
}

TEST(HostileInput, CountsAndRangesThatOverflowAreRefused) {
  const TemporaryFolder folder;
  const auto expect = [&](const std::function<void(nlohmann::json&)>& damage,
                          const std::vector<std::string>& parts) {
    WrittenScene scene = one_triangle();
    damage(scene.json);
    save(scene, folder / "scene");
    expect_refused(folder, folder / "scene/scene.gltf", 3, join({"scene.gltf"}, parts));
  };
  const nlohmann::json far = {{"count", 1},
                              {"indices", {{"bufferView", 0}, {"componentType", 5125}}},
                              {"values", {{"bufferView", 0}, {"byteOffset", 18446744073709551612ull}}}};
  expect([&](nlohmann::json& json) { json["accessors"][0]["sparse"] = far; }, {"accessors[0].sparse"});
  expect([](nlohmann::json& json) { json["accessors"][0]["count"] = 18446744073709551615ull; }, {"accessors[0]"});
  expect([](nlohmann::json& json) { json["accessors"][0]["byteOffset"] = 4294967292ull; }, {"accessors[0]"});
  expect([](nlohmann::json& json) { json["bufferViews"][0]["byteLength"] = 1e18; }, {"bufferViews[0]"});
  expect([](nlohmann::json& json) { json["nodes"][0]["children"] = {0}; }, {"nodes"});
  expect([](nlohmann::json& json) { json["nodes"][0]["mesh"] = 7; }, {"nodes[0].mesh"});
  expect([](nlohmann::json& json) { json["asset"]["version"] = "1.0"; }, {"asset.version"});
}

TEST(HostileInput, SceneWithoutTrianglesIsRefused) {
  const TemporaryFolder folder;
  WrittenScene no_mesh, no_primitive, flat;
  no_mesh.add_node({{"name", "nothing"}});
  const uint32_t point = flat.add_floats(3, {0, 0, 0, 0, 0, 0, 0, 0, 0});
  flat.add_node({{"mesh", flat.add_mesh({{"attributes", {{"POSITION", point}}}})}});
  save(no_mesh, folder / "no-mesh");
  save(flat, folder / "flat");
  for (const char* name : {"no-mesh", "flat"}) {
    expect_refused(folder, folder / (std::string(name) + "/scene.gltf"), 3, {name, "triangle"});
  }
}

TEST(HostileInput, RequiredExtensionsNotSupportedExitFourWithAdvice) {
  const TemporaryFolder folder;
  const std::vector<std::pair<std::string, std::string>> advice = {
      {"EXT_texture_avif", "convert its textures"},
      {"KHR_texture_basisu", "convert its textures"},
      {"ACME_teapot", "export the scene without it"},
  };
  for (const auto& [extension, what_to_do] : advice) {
    WrittenScene scene = one_triangle();
    scene.json["extensionsUsed"] = scene.json["extensionsRequired"] = nlohmann::json::array({extension});
    scene.json["textures"] = {{{"extensions", {{extension, {{"source", 0}}}}}}};
    save(scene, folder / "scene");
    expect_refused(folder, folder / "scene/scene.gltf", 4, {"scene.gltf", extension, "not supported", what_to_do});
  }
}

TEST(HostileInput, UnknownExtensionsInUseAreOneWarning) {
  const TemporaryFolder folder;
  WrittenScene scene = one_triangle();
  scene.json["extensionsUsed"] = {"ACME_teapot"};
  save(scene, folder / "scene");
  const ProgramRun run = run_shoal(folder, {"build", folder / "scene/scene.gltf", "-o", folder / "out.shoal",
                                            "--log-level", "warning", "--progress", "none"});
  expect_exit(run, 0);
  EXPECT_THAT(run.err, ::testing::HasSubstr("warning: ACME_teapot is not known and is ignored"));
  EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
}

}  // namespace
}  // namespace shoal::testing
