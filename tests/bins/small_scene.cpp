#include "tests/bins/small_scene.h"

#include <algorithm>

namespace shoal::testing {

void save(const WrittenScene& scene, const std::string& folder) {
  MemoryFileSystem memory;
  scene.save(memory);
  for (const std::string& name : memory.names()) {
    const std::vector<std::byte> bytes = memory.contents(name);
    put_file(folder + "/" + name, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  }
}

WrittenScene one_triangle() {
  WrittenScene scene;
  scene.add_node({{"mesh", scene.add_triangle_mesh(0, 1)}});
  return scene;
}

void make_terrain(const TemporaryFolder& folder, const std::string& triangles) {
  expect_exit(run_shoal(folder, {"generate", "terrain", "--triangles", triangles, "--out", folder / "terrain"}), 0);
  expect_exit(run_shoal(folder, {"build", folder / "terrain/terrain.gltf", "-o", folder / "terrain.shoal"}), 0);
}

std::vector<std::string> tiny_picture() { return {"--width", "24", "--height", "16", "--spp", "1"}; }

std::vector<std::string> join(std::vector<std::string> first, const std::vector<std::string>& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

void expect_exit(const ProgramRun& run, int exit_code) {
  EXPECT_FALSE(run.timed_out) << run.err;
  EXPECT_EQ(run.signal, 0) << run.err;
  EXPECT_EQ(run.exit_code, exit_code) << run.err << run.out;
}

void expect_error(const ProgramRun& run, int exit_code, const std::vector<std::string>& parts) {
  expect_exit(run, exit_code);
  const size_t at = run.err.find("shoal: ");
  ASSERT_NE(at, std::string::npos) << run.err;
  const std::string sentence = run.err.substr(at);
  EXPECT_EQ(std::count(sentence.begin(), sentence.end(), '\n'), 1) << sentence;
  EXPECT_LT(sentence.size(), 500u) << sentence;
  for (const std::string& part : parts) EXPECT_THAT(sentence, ::testing::HasSubstr(part));
}

}  // namespace shoal::testing
