// Whatever call of the file layer fails while a scene is built: the build ends with the right code, names the file, and
// leaves neither a file nor scratch space.
#include <gtest/gtest.h>

#include "engine/build_scene.h"
#include "tests/engine/bad_luck_scene.h"
#include "tests/support/faulty_file_system.h"

namespace shoal::testing {
namespace {

struct Build {
  const char* name;
  SceneBuildOptions options;
};

std::vector<Build> builds() {
  SceneBuildOptions at_once;
  at_once.threads = 1;
  at_once.treelet_bytes = 4u << 10;
  SceneBuildOptions in_chunks = at_once;
  in_chunks.chunk_triangles = 700;
  in_chunks.scratch_folder = "scratch";
  return {{"at once", at_once}, {"in chunks", in_chunks}};
}

std::vector<std::byte> clean_build(MemoryFileSystem& memory, const SceneBuildOptions& options) {
  const auto report = build_scene(memory, "scene.gltf", "clean.shoal", options);
  EXPECT_TRUE(report.ok()) << report.error().message;
  const auto bytes = memory.contents("clean.shoal");
  EXPECT_TRUE(memory.remove("clean.shoal").ok());
  return bytes;
}

/// Harms every call in turn until none is left to harm; how many there were.
uint64_t harm_every_call(MemoryFileSystem& memory, const Build& build, Fault fault) {
  const std::vector<std::string> before = memory.names();
  const std::vector<std::byte> clean = clean_build(memory, build.options);
  FaultyFileSystem fs(memory);
  for (uint64_t call = 0;; ++call) {
    fs.arm(fault, call);
    const auto report = build_scene(fs, "scene.gltf", "out.shoal", build.options);
    EXPECT_EQ(fs.scratch_files(), 0u) << build.name << " call " << call;
    if (report.ok()) {
      EXPECT_LE(fs.calls(), call) << build.name << ": a failed call was not noticed";
      EXPECT_EQ(memory.contents("out.shoal"), clean);
      EXPECT_TRUE(memory.remove("out.shoal").ok());
      return call;
    }
    const Error& error = report.error();
    EXPECT_EQ(error.code, ErrorCode::kStorage) << build.name << " call " << call << ": " << error.message;
    const bool names_a_file = error.message.find("scene.") != std::string::npos ||
                              error.message.find("image0.png") != std::string::npos ||
                              error.message.find("out.shoal") != std::string::npos ||
                              error.message.find("scratch file in") != std::string::npos;
    EXPECT_TRUE(names_a_file) << error.message;
    EXPECT_EQ(memory.names(), before) << build.name << " call " << call << " left a file";
    if (::testing::Test::HasFailure()) return call;
  }
}

TEST(BadLuckBuild, AnyCallThatFailsEndsTheBuildAndLeavesNothing) {
  MemoryFileSystem memory;
  save_bad_luck_scene(memory, 3000);
  for (const Build& build : builds()) {
    EXPECT_GE(harm_every_call(memory, build, Fault::kDiskFull), 4u) << build.name;  // create, write, sync, rename
    EXPECT_GE(harm_every_call(memory, build, Fault::kIoError), 12u) << build.name;
    EXPECT_GE(harm_every_call(memory, build, Fault::kShortRead), 4u) << build.name;
  }
}

TEST(BadLuckBuild, ADiskThatStaysFullKeepsTheFileThatWasThere) {
  MemoryFileSystem memory;
  save_bad_luck_scene(memory, 3000);
  memory.put("out.shoal", "before");
  FaultyFileSystem fs(memory);
  for (const Build& build : builds()) {
    for (uint64_t call = 0; call < 4; ++call) {
      fs.arm(Fault::kDiskFull, call, true);
      const auto report = build_scene(fs, "scene.gltf", "out.shoal", build.options);
      ASSERT_FALSE(report.ok());
      EXPECT_EQ(report.error().code, ErrorCode::kStorage);
      EXPECT_NE(report.error().message.find("disk full"), std::string::npos) << report.error().message;
      EXPECT_EQ(memory.contents("out.shoal").size(), 6u);
      EXPECT_EQ(fs.scratch_files(), 0u);
    }
  }
}

}  // namespace
}  // namespace shoal::testing
