// What the program says about itself, and exit code 2: options that are unknown, missing or out of range.
#include <algorithm>
#include <map>

#include "tests/bins/small_scene.h"

namespace shoal::testing {
namespace {

using ::testing::HasSubstr;

/// CLI11 words these itself: one sentence, then where help is.
void expect_usage(const ProgramRun& run, const std::vector<std::string>& parts) {
  expect_exit(run, 2);
  EXPECT_EQ(run.out, "");
  EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 2) << run.err;
  EXPECT_THAT(run.err, HasSubstr("Run with --help for more information."));
  for (const std::string& part : parts) EXPECT_THAT(run.err, HasSubstr(part));
}

TEST(Usage, HelpOfEverySubcommandExitsZeroAndPrintsItsOptions) {
  const TemporaryFolder folder;
  const std::map<std::string, std::vector<std::string>> expected = {
      {"build", {"--output", "--positions", "exact, 21, 16", "--builder", "sah, lbvh, karras", "--treelet-size", "--max-memory", "--threads", "--time", "--animation"}},
      {"render", {"--output",  "--width",      "--height",         "--spp",       "--bounces",
                  "--seed",    "--camera",     "--environment",    "--threads",   "--max-memory",
                  "--environment-rotation",    "--environment-intensity",
                  "--policy",  "--page-cache", "--rays-in-flight", "--cache-dir", "--png", "--preview",
                  "--checkpoint", "--resume", "--sample-range", "--tonemap", "--aov", "--time-limit", "--target-noise", "--exposure",   "--stats",          "--order",     "auto, queued, depth-first, sorted",
                  "--projection", "perspective, orthographic, equirectangular, fisheye", "--fov", "--ortho-height",
                  "--aperture", "--focus", "--distortion", "--time", "--animation",
                  "--triangle-test", "fast, watertight, double"}},
      {"merge", {"--output", "--png", "parts"}},
      {"compare", {"--orders", "--out", "--runs", "--kinds", "--kind-rays", "--width", "--spp", "--max-memory"}},
      {"accuracy", {"--out", "--budget", "--seeds", "--knobs", "--reference", "--reference-spp", "--width", "--max-memory",
                    "--camera", "--environment", "--exposure", "--order"}},
      {"info", {"--json"}},
      {"verify", {"file"}},
      {"diff", {"--json", "--cost-maps", "--flip"}},
      {"generate", {"--triangles", "--out", "--source", "--seed"}},
  };
  const ProgramRun whole = run_shoal(folder, {"--help"});
  expect_exit(whole, 0);
  EXPECT_THAT(whole.out, HasSubstr("Exit codes: 0 done"));
  for (const auto& [command, options] : expected) {
    EXPECT_THAT(whole.out, HasSubstr("\n  " + command)) << "the list of subcommands";
    const ProgramRun run = run_shoal(folder, {command, "--help"});
    expect_exit(run, 0);
    EXPECT_EQ(run.err, "") << command;
    for (const char* everywhere : {"--help", "--log-level", "--progress", "--quiet", "error, warning, info",
                                   "auto, bar, lines, json, none"}) {
      EXPECT_THAT(run.out, HasSubstr(everywhere)) << command;
    }
    for (const std::string& option : options) EXPECT_THAT(run.out, HasSubstr(option)) << command;
    for (const char c : run.out) ASSERT_TRUE(c == '\n' || static_cast<unsigned char>(c) >= 32) << command;
  }
}

TEST(Usage, VersionIsPrinted) {
  const TemporaryFolder folder;
  const ProgramRun run = run_shoal(folder, {"--version"});
  expect_exit(run, 0);
  EXPECT_THAT(run.out, ::testing::MatchesRegex("shoal [0-9]+\\.[0-9]+\\.[0-9]+\n"));
}

TEST(Usage, UnknownAndMissingOptionsExitTwoAndAreNamed) {
  const TemporaryFolder folder;
  expect_usage(run_shoal(folder, {}), {"subcommand"});
  expect_usage(run_shoal(folder, {"paint"}), {"subcommand"});
  expect_usage(run_shoal(folder, {"render"}), {"scene"});
  expect_usage(run_shoal(folder, {"render", "x.gltf"}), {"--output"});
  expect_usage(run_shoal(folder, {"render", "x.gltf", "-o", "y.exr", "--shiny"}), {"--shiny"});
  expect_usage(run_shoal(folder, {"build", "x.gltf"}), {"--output"});
  expect_usage(run_shoal(folder, {"build", "x.gltf", "-o", "y.shoal", "--positions", "20"}),
               {"--positions", "expected exact, 21 or 16, found '20'"});
  expect_usage(run_shoal(folder, {"compare", "x.gltf"}), {"--out"});
  expect_usage(run_shoal(folder, {"accuracy", "x.gltf"}), {"--out"});
  expect_usage(run_shoal(folder, {"generate", "terrain"}), {"--out"});
  expect_usage(run_shoal(folder, {"diff", "x.exr"}), {"b is required"});
  expect_usage(run_shoal(folder, {"info"}), {"file"});
}

TEST(Usage, ValuesThatAreNotOfTheirKindExitTwoAndAreNamed) {
  const TemporaryFolder folder;
  const std::vector<std::string> render = {"render", "x.gltf", "-o", folder / "y.exr"};
  expect_usage(run_shoal(folder, join(render, {"--spp", "many"})), {"--spp", "many"});
  expect_usage(run_shoal(folder, join(render, {"--width", "-3"})), {"--width", "-3"});
  expect_usage(run_shoal(folder, join(render, {"--order", "random"})),
               {"--order", "auto, queued, depth-first, sorted", "'random'"});
  expect_usage(run_shoal(folder, join(render, {"--sampler", "magic"})),
               {"--sampler", "independent, sobol, blue-noise", "'magic'"});
  expect_usage(run_shoal(folder, join(render, {"--progress", "loud"})), {"--progress", "json", "'loud'"});
  expect_usage(run_shoal(folder, join(render, {"--log-level", "loud"})), {"--log-level", "warning", "'loud'"});
  expect_usage(run_shoal(folder, join(render, {"--state-levels", "33"})), {"--state-levels", "33"});
  EXPECT_THAT(folder.names(), ::testing::IsEmpty());
}

TEST(Usage, ValuesThatMakeNoSenseExitTwoBeforeAnythingIsRead) {
  const TemporaryFolder folder;
  const std::vector<std::string> render = {"render", folder / "missing.shoal", "-o", folder / "y.exr"};
  const auto expect = [&](const std::vector<std::string>& options, const std::vector<std::string>& parts) {
    expect_error(run_shoal(folder, join(render, options)), 2, parts);
  };
  expect({"--max-memory", "banana"}, {"'banana' is not a size", "K, M, G or T"});
  expect({"--max-memory", "-1G"}, {"'-1G' is not a size"});
  expect({"--max-memory", "1X"}, {"'1X' is not a size"});
  expect({"--max-memory", "nan"}, {"'nan' is not a size"});
  expect({"--page-cache", "much"}, {"'much' is not a size"});
  expect({"--environment", "constant:1,2"}, {"'constant:1,2' is not an environment", "constant:R,G,B"});
  expect({"--environment", "constant:1,2,x"}, {"is not an environment"});
  expect({"--environment", "constant:1,-2,3"}, {"is not an environment"});
  expect({"--environment", "constant:nan,0,0"}, {"is not an environment"});
  expect({"--environment", "constant:1,1,1", "--environment-intensity", "-1"}, {"expected a number >= 0"});
  expect({"--environment", "constant:1,1,1", "--environment-intensity", "nan"}, {"expected a number >= 0"});
  expect({"--environment", "constant:1,1,1", "--environment-rotation", "inf"}, {"expected degrees"});
  expect({"--environment-rotation", "90"}, {"--environment"});
  expect({"--treelet-size", "1K"}, {"treelet size of 1024 bytes", "4K to 4M"});
  expect({"--treelet-size", "8M"}, {"treelet size of 8388608 bytes", "4K to 4M"});
  expect({"--tonemap", "sepia"}, {"pbr-neutral", "sepia"});
  expect({"--exposure", "nan"}, {"exposure"});
  for (const char* noise : {"0", "2%:1%", "little"}) expect({"--target-noise", noise}, {noise, "median", "2%:5%"});
  for (const char* limit : {"0", "-3", "nan", "inf"}) expect({"--time-limit", limit}, {"--time-limit", "more than 0"});
  expect({"--time-limit", "3", "--sampler", "blue-noise"}, {"--time-limit", "blue-noise"});
  expect({"--aov", "albedo,shine"}, {"unknown AOV 'shine'", "albedo, normal, depth", "all"});
  expect_error(run_shoal(folder, {"build", "x.gltf", "-o", folder / "y.shoal", "--treelet-size", "4095"}), 2,
               {"4095 bytes", "4K to 4M"});
  expect_error(run_shoal(folder, {"generate", "planet", "--out", folder / "g"}), 2, {"terrain", "planet"});
  expect_error(run_shoal(folder, {"generate", "terrain", "--triangles", "many", "--out", folder / "g"}), 2,
               {"'many' is not a count"});
  EXPECT_THAT(folder.names(), ::testing::IsEmpty());
}

TEST(Usage, WhatDoesNotFitTheSceneExitsTwo) {
  const TemporaryFolder folder;
  make_terrain(folder, "1K");
  const std::vector<std::string> render = {"render", folder / "terrain.shoal", "-o", folder / "y.exr"};
  const auto expect = [&](const std::vector<std::string>& options, const std::vector<std::string>& parts) {
    expect_error(run_shoal(folder, join(render, options)), 2, parts);
  };
  expect({"--camera", "7"}, {"camera 7", "the scene has 1"});
  expect({"--spp", "0"}, {"0 samples a pixel", "must be 1 to"});
  expect({"--spp", "4194305"}, {"4194305 samples a pixel"});
  expect({"--width", "0"}, {"0 x 512 pixels"});
  expect({"--width", "65537"}, {"65537 x 512 pixels"});
  expect({"--width", "65536", "--height", "65536"}, {"65536 x 65536 pixels"});
  expect({"--policy", "laziest"}, {"unknown policy 'laziest'", "resident-first", "sweep"});
  expect_error(run_shoal(folder, {"compare", folder / "terrain.shoal", "--orders", "queued,zigzag", "--out",
                                  folder / "c", "--width", "8", "--height", "8", "--spp", "1"}),
               2, {"unknown order 'zigzag'", "auto, queued, depth-first, sorted"});
  const auto expect_orders = [&](const std::string& orders, const std::vector<std::string>& parts) {
    expect_error(run_shoal(folder, {"compare", folder / "terrain.shoal", "--orders", orders, "--out", folder / "c"}), 2, parts);
  };
  expect_orders("queued:laziest", {"'queued:laziest'", "resident-first, fullest, sweep, full"});
  expect_orders("packet:full", {"'packet:full'", "only the queued order"});
  expect_orders("packet,queued,packet", {"'packet' twice"});
  expect({"--packet-size", "48"}, {"--packet-size", "48"});
  EXPECT_THAT(folder.names(), ::testing::ElementsAre("terrain", "terrain.shoal"));
}

TEST(Usage, EveryPolicyAndCapacityOfQueuesEnds) {
  const TemporaryFolder folder;
  make_terrain(folder, "1K");
  const std::vector<std::pair<std::string, std::string>> policies = {
      {"resident-first", "4096"}, {"fullest", "4096"}, {"sweep", "4096"}, {"full", "0"}, {"full", "1"},
      {"full", "1000000"},
  };
  for (const auto& [policy, capacity] : policies) {
    expect_exit(run_shoal(folder, join({"render", folder / "terrain.shoal", "-o", folder / "y.exr", "--policy",
                                        policy, "--queue-capacity", capacity, "--quiet"},
                                       tiny_picture())),
                0);
  }
}

}  // namespace
}  // namespace shoal::testing
