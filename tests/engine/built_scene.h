// A glTF built into memory and opened again, with every triangle read back by the independent reader of
// tests/support/treelet_reader.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "engine/build_scene.h"
#include "engine/scene.h"
#include "tests/support/memory_file_system.h"
#include "tests/support/treelet_reader.h"
#include "tests/support/written_scene.h"

namespace shoal::testing {

struct BuiltScene {
  SceneBuildReport report;
  Scene scene;
  std::vector<std::vector<ReadTriangle>> objects;  ///< by object, in order of primitive; none above the limit
};

/// Builds scene.gltf of `fs` into scene.shoal, opens it, runs PageFile::verify and check_page on every page.
/// Fails the test, and throws, when anything fails.
BuiltScene build_and_open(FileSystem& fs, const SceneBuildOptions& options = {},
                          const std::string& path = "scene.gltf", const std::string& output = "scene.shoal",
                          uint64_t read_back_limit = 100000);

/// The message of the build's error; fails the test when it succeeds or has another code.
std::string build_error(FileSystem& fs, ErrorCode code, const SceneBuildOptions& options = {});

/// Reads and checks every page but tables. The first error.
Status check_all_pages(const Scene& scene);

}  // namespace shoal::testing
