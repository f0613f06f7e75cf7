// shoal accuracy: its files, its exit codes, and that it keeps to the cap.
#include <signal.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>
#include <thread>

#include "tests/bins/small_scene.h"
#include "tests/support/white_box.h"
#include "tests/support/sanitized.h"

namespace shoal::testing {
namespace {

using ::testing::HasSubstr;
using nlohmann::json;

/// The white box under a white sky, a few pixels; `options` (pairs) add to what else is asked or take its place.
std::vector<std::string> accuracy(const TemporaryFolder& folder, const std::vector<std::string>& options = {}) {
  std::map<std::string, std::string> asked = {
      {"--out", folder / "out"}, {"--width", "24"},    {"--height", "16"},   {"--spp", "2"},
      {"--reference-spp", "64"}, {"--budget", "none"}, {"--progress", "none"}, {"--environment", "constant:1,1,1"}};
  for (size_t i = 0; i + 1 < options.size(); i += 2) asked[options[i]] = options[i + 1];
  std::vector<std::string> command = {"accuracy", folder / "scene.gltf"};
  for (const auto& [option, value] : asked) command.push_back(option + "=" + value);
  return command;
}

json result_of(const TemporaryFolder& folder) {
  return json::parse(file_text(folder / "out/accuracy.json"), nullptr, false);
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line.substr(0, line.find('\r')));
  return lines;
}

TEST(Accuracy, WritesItsFilesAndPrintsItsRows) {
  const TemporaryFolder folder;
  save(white_box(), folder / "");
  const ProgramRun run = run_shoal(folder, accuracy(folder, {"--knobs", "samples,bounces"}));
  expect_exit(run, 0);
  const json result = result_of(folder);
  ASSERT_TRUE(result.is_object());
  const std::vector<std::string> csv = lines_of(file_text(folder / "out/accuracy.csv"));
  ASSERT_EQ(csv.size(), result["rows"].size() + 1);
  const auto columns = std::count(csv[0].begin(), csv[0].end(), ',') + 1;
  EXPECT_EQ(columns, static_cast<long>(result["columns"].size() + result["knobs"].size()));
  EXPECT_EQ(result["picture"]["width"], 24);
  EXPECT_EQ(result["seeds_count"], 4);
  bool few_is_biased = false;
  for (const json& row : result["rows"]) {
    if (row["knob"] != "together") {
      EXPECT_THAT(run.out, HasSubstr(row["name"].get<std::string>()));
    }
    if (row["name"] == "bounces 1") few_is_biased = row["biased"];
    EXPECT_GT(row["render_seconds"], 0);
    EXPECT_GT(row["machine_pace"], 0);
    EXPECT_GT(row["file_bytes_per_triangle"], 0);
  }
  EXPECT_TRUE(few_is_biased);
  EXPECT_FALSE(result["rows"][0]["build_seconds"].is_null()) << "the scene was built for this run";
  EXPECT_THAT(run.out, HasSubstr("Doubling samples from 1 to 2 takes"));
  EXPECT_THAT(run.out, HasSubstr("bounces 1 instead of 8 takes"));
}

TEST(Accuracy, OptionsThatMakeNoSenseExitTwoBeforeAnythingIsWritten) {
  const TemporaryFolder folder;
  const auto expect = [&](const std::vector<std::string>& options, const std::vector<std::string>& parts) {
    expect_error(run_shoal(folder, accuracy(folder, options)), 2, parts);
  };
  expect({"--knobs", "samples,shine"}, {"unknown knob 'shine'", "samples, sampler, bounces, roulette"});
  expect({"--budget", "soon"}, {"'soon' is not a time", "s, m or h"});
  expect({"--budget", "-5m"}, {"'-5m' is not a time"});
  expect({"--budget", "5d"}, {"'5d' is not a time"});
  expect({"--tonemap", "sepia"}, {"pbr-neutral"});
  expect({"--exposure", "inf"}, {"exposure"});
  expect({"--tile-sample", "4"}, {"--tile-sample"});
  expect({"--width", "0"}, {"0 x 16 pixels"});
  expect_exit(run_shoal(folder, accuracy(folder, {"--seeds", "2"})), 2);
  expect_exit(run_shoal(folder, accuracy(folder, {"--reference-spp", "3"})), 2);
  EXPECT_THAT(folder.names(), ::testing::IsEmpty());
}

TEST(Accuracy, ScenesAndReferencesThatCannotBeUsedAreNamed) {
  const TemporaryFolder folder;
  expect_error(run_shoal(folder, accuracy(folder)), 3, {"scene.gltf"});
  save(white_box(), folder / "");
  expect_error(run_shoal(folder, accuracy(folder, {"--reference", folder / "missing.exr"})), 3, {"missing.exr"});
  expect_exit(run_shoal(folder, {"render", folder / "scene.gltf", "-o", folder / "other.exr", "--width", "8", "--height", "8",
                                 "--spp", "1", "--quiet"}),
              0);
  expect_error(run_shoal(folder, accuracy(folder, {"--reference", folder / "other.exr"})), 3,
               {"other.exr", "24 x 16", "8 x 8"});
  EXPECT_FALSE(std::filesystem::exists(folder / "out/accuracy.json"));
}

TEST(Accuracy, AReferenceWithTheLayersVarianceAndSamplesHasKnownNoise) {
  const TemporaryFolder folder;
  save(white_box(), folder / "");
  for (const std::vector<std::string>& layers : {std::vector<std::string>{}, {"--aov", "variance,samples"}}) {
    expect_exit(run_shoal(folder, join({"render", folder / "scene.gltf", "-o", folder / "reference.exr", "--width", "24",
                                        "--height", "16", "--spp", "64", "--bounces", "32", "--seed", "99", "--environment",
                                        "constant:1,1,1", "--sampler", "independent", "--quiet"},
                                       layers)),
                0);
    expect_exit(run_shoal(folder, accuracy(folder, {"--knobs", "roulette", "--reference", folder / "reference.exr"})), 0);
    const json result = result_of(folder);
    EXPECT_EQ(result["reference"]["given"], true);
    EXPECT_EQ(result["reference"]["noise_known"], !layers.empty());
    EXPECT_EQ(result["reference"]["noise"].is_null(), layers.empty());
  }
}

TEST(Accuracy, ACapThatCannotWorkIsRefusedAndTheNamedOneHolds) {
  const TemporaryFolder folder;
  save(white_box(), folder / "");
  const std::vector<std::string> options = {"--knobs", "roulette", "--threads", "2"};
  const ProgramRun refused = run_shoal(folder, join(accuracy(folder, options), {"--max-memory", "1M"}));
  expect_error(refused, 5, {"memory cap is 1 MiB"});
  expect_exit(run_shoal(folder, {"build", folder / "scene.gltf", "-o", folder / "scene.shoal", "--quiet"}), 0);
  std::vector<std::string> small = join(accuracy(folder, options), {"--max-memory", "2M"});
  small[1] = folder / "scene.shoal";
  const ProgramRun tight = run_shoal(folder, small);
  std::smatch match;
  ASSERT_TRUE(std::regex_search(tight.err, match, std::regex("about ([0-9]+) MiB"))) << tight.err;
  small.back() = match[1].str() + "M";
  expect_exit(run_shoal(folder, small), 0);
  const json result = result_of(folder);
  if (!kSanitized) {
    EXPECT_LE(result["peak_rss_bytes"], result["max_memory_bytes"]);
  }
}

TEST(Accuracy, ASignalStopsItAndLeavesNoFile) {
  const TemporaryFolder folder;
  save(white_box(), folder / "");
  Program program(folder, join({SHOAL_BINARY}, accuracy(folder, {"--progress", "json", "--spp", "20000"})));
  while (program.running() && program.err().find("\"reference\"") == std::string::npos) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  program.send(SIGTERM);
  expect_exit(program.wait(std::chrono::seconds(60)), 9);
  EXPECT_TRUE(std::filesystem::is_empty(folder / "out"));
}

}  // namespace
}  // namespace shoal::testing
