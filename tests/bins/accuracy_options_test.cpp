// The options that trade accuracy for time: under one heading, named in --stats and in the picture, and refused where they
// make no sense.
#include <nlohmann/json.hpp>

#include "io/image.h"
#include "tests/bins/small_scene.h"

namespace shoal::testing {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

std::string attribute(const std::string& path, const std::string& name) {
  const auto image = read_exr(posix_file_system(), path, 1 << 20);
  if (!image.ok()) return image.error().message;
  return image.value().text.contains(name) ? image.value().text.at(name) : "missing";
}

TEST(AccuracyOptions, StandUnderOneHeadingOfTheHelp) {
  const TemporaryFolder folder;
  for (const char* command : {"render", "compare"}) {
    const std::string help = run_shoal(folder, {command, "--help"}).out;
    const size_t heading = help.find("Accuracy:");
    ASSERT_NE(heading, std::string::npos) << command;
    const std::string section = help.substr(heading, help.find("\n\n", heading) - heading);
    for (const char* option : {"--spp", "--sampler", "--bounces", "--roulette-start", "--clamp-direct", "--clamp-indirect",
                               "--light-choice", "tree, power, uniform", "--texture-filter"}) {
      EXPECT_THAT(section, HasSubstr(option)) << command;
    }
  }
}

TEST(AccuracyOptions, AreNamedInStatsAndInThePicture) {
  const TemporaryFolder folder;
  make_terrain(folder);
  const auto render = [&](const std::vector<std::string>& options) {
    expect_exit(run_shoal(folder, join(join({"render", folder / "terrain.shoal", "-o", folder / "out.exr", "--stats",
                                             folder / "out.json"}, options), tiny_picture())), 0);
    return json::parse(file_text(folder / "out.json"))["options"];
  };
  const json usual = render({});
  EXPECT_EQ(usual["sampler"], "sobol");
  EXPECT_EQ(usual["light_choice"], "tree");
  EXPECT_EQ(usual["texture_filter"], "mip");
  EXPECT_EQ(usual["roulette_start"], 3);
  EXPECT_EQ(usual["clamp_direct"], 0);
  EXPECT_EQ(usual["clamp_indirect"], 0);
  EXPECT_EQ(attribute(folder / "out.exr", "sampler"), "sobol");
  const json other = render({"--sampler", "blue-noise", "--light-choice", "uniform", "--texture-filter", "bilinear",
                             "--roulette-start", "off", "--clamp-direct", "2.5", "--clamp-indirect", "0.5"});
  EXPECT_EQ(other["sampler"], "blue-noise");
  EXPECT_EQ(other["light_choice"], "uniform");
  EXPECT_EQ(other["texture_filter"], "bilinear");
  EXPECT_EQ(other["roulette_start"], "off");
  EXPECT_EQ(other["clamp_direct"], 2.5);
  EXPECT_EQ(other["clamp_indirect"], 0.5);
  EXPECT_EQ(attribute(folder / "out.exr", "sampler"), "blue-noise");
  EXPECT_EQ(attribute(folder / "out.exr", "lightChoice"), "uniform");
  EXPECT_EQ(attribute(folder / "out.exr", "textureFilter"), "bilinear");
  EXPECT_EQ(attribute(folder / "out.exr", "rouletteStart"), "off");
  EXPECT_EQ(render({"--roulette-start", "7"})["roulette_start"], 7);
}

TEST(AccuracyOptions, ValuesThatMakeNoSenseExitTwo) {
  const TemporaryFolder folder;
  make_terrain(folder, "1K");
  const std::vector<std::string> render =
      join({"render", folder / "terrain.shoal", "-o", folder / "y.exr"}, tiny_picture());
  for (const char* value : {"soon", "-1", "3x", "", "4294967296"}) {
    const ProgramRun run = run_shoal(folder, join(render, {"--roulette-start", value}));
    expect_exit(run, 2);
    EXPECT_THAT(run.err, HasSubstr("--roulette-start")) << value;
  }
  for (const char* option : {"--clamp-direct", "--clamp-indirect"}) {
    for (const char* value : {"-1", "nan", "inf"}) {
      const ProgramRun run = run_shoal(folder, join(render, {option, value}));
      expect_exit(run, 2);
      EXPECT_THAT(run.err, HasSubstr("must be a number >= 0")) << option << value;
    }
  }
}

}  // namespace
}  // namespace shoal::testing
