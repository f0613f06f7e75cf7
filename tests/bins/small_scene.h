// Small scenes on disk, and what the tests of the program expect of every run. Used by tests/bins.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/bins/program.h"
#include "tests/support/written_scene.h"

namespace shoal::testing {

/// Writes scene.gltf, scene.bin and images into a folder.
void save(const WrittenScene& scene, const std::string& folder);
/// One triangle, no camera, no light.
WrittenScene one_triangle();
/// Generates a terrain of about so many triangles (terrain.gltf in `name`) and builds terrain.shoal of it.
void make_terrain(const TemporaryFolder& folder, const std::string& triangles = "20K");

/// Options of the smallest picture worth rendering.
std::vector<std::string> tiny_picture();
std::vector<std::string> join(std::vector<std::string> first, const std::vector<std::string>& second);

/// The run ended with this exit code, by itself and in time.
void expect_exit(const ProgramRun& run, int exit_code);
/// ... and said why in one sentence on stderr that starts with the program's name and holds every one of `parts`.
void expect_error(const ProgramRun& run, int exit_code, const std::vector<std::string>& parts);

}  // namespace shoal::testing
