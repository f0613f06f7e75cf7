// What is said while a command works: JSON lines, plain lines, or nothing.
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/bins/small_scene.h"

namespace shoal::testing {
namespace {

std::vector<std::vector<std::string>> commands(const TemporaryFolder& folder) {
  return {
      {"generate", "terrain", "--triangles", "1K", "--out", folder / "again"},
      {"build", folder / "terrain/terrain.gltf", "-o", folder / "again.shoal"},
      join({"render", folder / "terrain/terrain.gltf", "-o", folder / "out.exr"}, tiny_picture()),
      join({"compare", folder / "terrain.shoal", "--out", folder / "compare"}, tiny_picture()),
  };
}

/// Every line is one JSON object; returns how many of them report progress.
size_t expect_json_lines(const std::string& text) {
  std::istringstream lines(text);
  size_t progress_count = 0;
  for (std::string line; std::getline(lines, line);) {
    const nlohmann::json object = nlohmann::json::parse(line, nullptr, false);
    if (!object.is_object()) {
      ADD_FAILURE() << "not a JSON object: " << line;
      continue;
    }
    const bool progress = object.contains("stage");
    progress_count += progress;
    const std::vector<const char*> keys =
        progress ? std::vector{"fraction", "seconds", "seconds_left", "rss_bytes", "detail"}
                 : std::vector{"level", "message"};
    for (const char* key : keys) EXPECT_TRUE(object.contains(key)) << key << " is missing in " << line;
    if (!progress) continue;
    EXPECT_TRUE(object["seconds_left"].is_number() || object["seconds_left"].is_null()) << line;
    EXPECT_GE(object["fraction"], 0) << line;
    EXPECT_LE(object["fraction"], 1) << line;
  }
  return progress_count;
}

TEST(Progress, JsonModePrintsOneObjectALine) {
  const TemporaryFolder folder;
  make_terrain(folder, "1K");
  for (const auto& command : commands(folder)) {
    const ProgramRun run = run_shoal(folder, join(command, {"--progress", "json"}));
    expect_exit(run, 0);
    EXPECT_GT(expect_json_lines(run.err), 0u) << command[0];
    EXPECT_EQ(run.out.find('{'), std::string::npos) << run.out;
  }
}

TEST(Progress, JsonModePrintsErrorsAndOddNamesAsJson) {
  const TemporaryFolder folder;
  const ProgramRun run =
      run_shoal(folder, {"build", folder / "odd\xff\"name.gltf", "-o", folder / "x.shoal", "--progress", "json"});
  expect_exit(run, 3);
  expect_json_lines(run.err);
  ASSERT_TRUE(run.err.ends_with('\n'));
  const size_t last = run.err.rfind('\n', run.err.size() - 2) + 1;
  const nlohmann::json error = nlohmann::json::parse(run.err.substr(last), nullptr, false);
  ASSERT_TRUE(error.is_object()) << run.err;
  EXPECT_EQ(error["level"], "error");
  EXPECT_EQ(error["exit_code"], 3);
}

TEST(Progress, QuietModesPrintNothingOnSuccess) {
  const TemporaryFolder folder;
  make_terrain(folder, "1K");
  for (const auto& command : commands(folder)) {
    const ProgramRun quiet = run_shoal(folder, join(command, {"--quiet"}));
    expect_exit(quiet, 0);
    EXPECT_EQ(quiet.err, "") << command[0];
    const ProgramRun none = run_shoal(folder, join(command, {"--progress", "none", "--log-level", "warning"}));
    expect_exit(none, 0);
    EXPECT_EQ(none.err, "") << command[0];
  }
}

TEST(Progress, WithoutATerminalPlainLinesArePrinted) {
  const TemporaryFolder folder;
  make_terrain(folder, "1K");
  const ProgramRun run =
      run_shoal(folder, join({"render", folder / "terrain.shoal", "-o", folder / "out.exr"}, tiny_picture()));
  expect_exit(run, 0);
  EXPECT_THAT(run.err, ::testing::ContainsRegex("[0-9][0-9]:[0-9][0-9]:[0-9][0-9] +[0-9]+ MB \\| rendering "));
  for (const char c : run.err) ASSERT_TRUE(c == '\n' || static_cast<unsigned char>(c) >= 32) << run.err;
}

}  // namespace
}  // namespace shoal::testing
