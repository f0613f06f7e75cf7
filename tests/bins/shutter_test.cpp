// Motion blur by --shutter: against still pictures, in every order.
#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>

#include "tests/bins/seen_pictures.h"

namespace shoal::testing {
namespace {

/// The mean of the alpha channel.
double covered(const std::vector<float>& picture) {
  const size_t pixels = picture.size() / 4;
  double sum = 0;
  for (size_t i = 0; i < pixels; ++i) sum += picture[i];  // channels by name: A first
  return sum / static_cast<double>(pixels);
}

TEST(Shutter, AShutterShowsTheMeanOfItsTimesInEveryOrder) {
  const Pictures pictures;
  const std::vector<std::string> blurred = {"--shutter", "0:0.02", "--spp", "64", "--bounces", "1"};
  const std::vector<float> picture = pictures.render("blurred", blurred);
  double still = 0;
  constexpr int kStills = 20;
  for (int i = 0; i < kStills; ++i) {
    const std::string time = fmt::format("{}", 0.02 * (i + 0.5) / kStills);
    still += covered(pictures.render("still", {"--time", time, "--spp", "8", "--bounces", "1"})) / kStills;
  }
  EXPECT_GT(still, 0.005);
  EXPECT_NEAR(covered(picture), still, 0.03 * still);
  EXPECT_NE(picture, pictures.render("instant", {"--spp", "64", "--bounces", "1"}));
  for (const char* order : {"queued", "depth-first", "sorted", "hybrid"}) {
    EXPECT_EQ(pictures.render(order, join(blurred, {"--order", order, "--threads", "1"})), picture) << order;
  }
}

/// Half a turn of the triangle about its corner, in a second; or of the camera, about where it looks.
WrittenScene turning_triangle(uint32_t node) {
  WrittenScene scene = one_triangle();
  scene.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.8}, {"znear", 0.1}}}}};
  scene.add_node({{"camera", 0}, {"translation", {0, 0, 3}}});
  const uint32_t input = scene.add_floats(1, {0, 1}), output = scene.add_floats(4, {0, 0, 0, 1, 0, 0, 1, 0});
  scene.json["animations"] = {{{"channels", {{{"sampler", 0}, {"target", {{"node", node}, {"path", "rotation"}}}}}},
                               {"samplers", {{{"input", input}, {"output", output}}}}}};
  return scene;
}

/// The blurred picture against the mean of still ones, pixel by pixel.
void expect_mean_of_stills(const Pictures& pictures, const std::string& scene) {
  constexpr int kStills = 32, kStillSamples = 32, kSamples = 512;
  const std::string samples = fmt::format("{}", kSamples);
  const std::vector<float> blurred =
      pictures.render("blurred", {"--shutter", "0:1", "--spp", samples, "--bounces", "1"}, scene);
  std::vector<double> mean(blurred.size());
  for (int i = 0; i < kStills; ++i) {
    const std::vector<float> still =
        pictures.render("still", {"--time", fmt::format("{}", (i + 0.5) / kStills), "--spp",
                                  fmt::format("{}", kStillSamples), "--bounces", "1"}, scene);
    ASSERT_EQ(still.size(), blurred.size());
    for (size_t p = 0; p < still.size(); ++p) mean[p] += still[p] / kStills;
  }
  // Alpha is 1 or 0 a sample, so both are binomial, at worst. A pixel's times in the triangle are one interval, whose
  // ends fall between two stills each: those stills show what blurs to a half as 0 or 1.
  double covered_pixels = 0, sum = 0, variance = 0;
  for (size_t p = 0; p < blurred.size() / 4; ++p) {
    const double alpha = std::clamp(mean[p], 0.02, 0.98);
    const double deviation = std::sqrt(alpha * (1 - alpha) * (1.0 / kSamples + 1.0 / (kStills * kStillSamples)));
    EXPECT_NEAR(blurred[p], mean[p], 4.5 * deviation + 1.0 / kStills) << p;
    sum += blurred[p] - mean[p], variance += deviation * deviation;
    covered_pixels += mean[p] > 0.02 && mean[p] < 0.98;
  }
  EXPECT_GT(covered_pixels, 200);
  EXPECT_LT(std::abs(sum), 4.5 * std::sqrt(variance));
}

TEST(Shutter, AFastTurnIsTheMeanOfStillPicturesInEveryPixel) {
  const Pictures pictures;
  save(turning_triangle(0), pictures.folder / "turn");
  expect_mean_of_stills(pictures, "turn/scene.gltf");
}

TEST(Shutter, ACameraThatTurnsSeesTheMeanOfStillPicturesInEveryOrder) {
  const Pictures pictures;
  save(turning_triangle(1), pictures.folder / "roll");
  const std::string scene = "roll/scene.gltf";
  expect_mean_of_stills(pictures, scene);
  const std::vector<float> picture = pictures.render("roll", {"--shutter", "0:1", "--spp", "8"}, scene);
  for (const char* order : {"queued", "depth-first", "sorted", "hybrid"}) {
    EXPECT_EQ(pictures.render(order, {"--shutter", "0:1", "--spp", "8", "--order", order}, scene), picture) << order;
  }
}

/// A white cube of side 1 about (far, 0, 0), and a node that takes it before the camera and turns it about that place.
WrittenScene turning_cube(float far, float degrees) {
  WrittenScene scene;
  std::vector<float> corners;
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-0.5f, 0.5f}) {
      for (const int k : {0, 1, 3, 0, 3, 2}) {
        const float a = (k & 1) != 0 ? 0.5f : -0.5f, b = (k & 2) != 0 ? 0.5f : -0.5f;
        float p[3];
        p[axis] = side, p[(axis + 1) % 3] = side > 0 ? a : b, p[(axis + 2) % 3] = side > 0 ? b : a;
        corners.insert(corners.end(), {p[0] + far, p[1], p[2]});
      }
    }
  }
  scene.json["materials"] = {{{"pbrMetallicRoughness", {{"metallicFactor", 0}}},
                              {"extensions", {{"KHR_materials_specular", {{"specularFactor", 0}}}}}}};
  scene.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 0.1}}}}};
  const uint32_t positions = scene.add_floats(3, corners);
  scene.add_node({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", positions}}}, {"material", 0}})}});
  scene.add_node({{"camera", 0}, {"translation", {0.3, 0, 5}}});
  const float half = degrees * 3.14159265f / 360;
  const uint32_t input = scene.add_floats(1, {0, 1});
  const uint32_t places = scene.add_floats(3, {-far, 0, 0, 0.5f - far, 0, 0});
  const uint32_t turns = scene.add_floats(4, {0, 0, 0, 1, 0, std::sin(half), 0, std::cos(half)});
  nlohmann::json& animation = scene.json["animations"][0];
  animation["channels"] = {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}},
                           {{"sampler", 1}, {"target", {{"node", 0}, {"path", "rotation"}}}}};
  animation["samplers"] = {{{"input", input}, {"output", places}}, {{"input", input}, {"output", turns}}};
  return scene;
}

TEST(Shutter, RaysLeaveWhatMovesAtTheTimeThatTheyMetIt) {
  const Pictures pictures;
  for (const auto& [far, degrees] : {std::pair{0.0f, 170.0f}, {1000.0f, 0.03f}}) {
    save(turning_cube(far, degrees), pictures.folder / "cube");
    // White and convex in a white world: every sample is 1, unless a ray meets the cube again.
    const std::vector<float> picture =
        pictures.render("cube", {"--shutter", "0:1", "--spp", "64", "--bounces", "2"}, "cube/scene.gltf");
    size_t blurred = 0, hidden = 0;
    for (size_t p = 0; p < 48 * 32; ++p) blurred += picture[p] > 0 && picture[p] < 1, hidden += picture[p] == 1;
    EXPECT_GT(blurred, 50u) << far;
    EXPECT_GT(hidden, 50u) << far;
    for (size_t i = 48 * 32; i < picture.size(); ++i) EXPECT_NEAR(picture[i], 1, 1e-3) << far << " " << i % (48 * 32);
  }
}

/// A cave whose rocks and lanterns, which emit, rise and turn in a second, in many treelets.
void make_moving_cave(const TemporaryFolder& folder) {
  expect_exit(run_shoal(folder, {"generate", "terrain", "--triangles", "20K", "--out", folder / "cave", "--quiet"}), 0);
  nlohmann::json gltf = nlohmann::json::parse(file_text(folder / "cave/terrain.gltf"));
  const float values[] = {0, 1, 0, 0, 0, 0.1f, 0.3f, 0, 0, 0, 0, 1, 0, 0.1f, 0, 0.995f};  // times, places, rotations
  put_file(folder / "cave/motion.bin", {reinterpret_cast<const char*>(values), sizeof(values)});
  const size_t buffer = gltf["buffers"].size(), view = gltf["bufferViews"].size(), first = gltf["accessors"].size();
  gltf["buffers"].push_back({{"uri", "motion.bin"}, {"byteLength", sizeof(values)}});
  gltf["bufferViews"].push_back({{"buffer", buffer}, {"byteLength", sizeof(values)}});
  const auto add = [&](size_t offset, const char* type) {
    gltf["accessors"].push_back({{"bufferView", view}, {"byteOffset", offset}, {"componentType", 5126}, {"count", 2},
                                 {"type", type}, {"min", {0}}, {"max", {1}}});
    if (offset > 0) gltf["accessors"].back().erase("min"), gltf["accessors"].back().erase("max");
  };
  add(0, "SCALAR"), add(8, "VEC3"), add(32, "VEC4");
  nlohmann::json animation = {{"samplers", {{{"input", first}, {"output", first + 1}},
                                            {{"input", first}, {"output", first + 2}}}}};
  for (size_t node = 0; node < gltf["nodes"].size(); ++node) {
    const std::string name = gltf["nodes"][node].value("name", "");
    if (name != "rocks" && name != "lanterns") continue;
    for (const int sampler : {0, 1}) {
      const char* path = sampler == 0 ? "translation" : "rotation";
      animation["channels"].push_back({{"sampler", sampler}, {"target", {{"node", node}, {"path", path}}}});
    }
  }
  gltf["animations"] = {animation};
  put_file(folder / "cave/terrain.gltf", gltf.dump());
}

TEST(Shutter, MovingTreeletsAreMetAlikeInEveryOrderByAnyThreadsWithFewPages) {
  const Pictures pictures;
  make_moving_cave(pictures.folder);
  const std::string source = pictures.folder / "cave/terrain.gltf", built = pictures.folder / "cave.shoal";
  const std::vector<std::string> build = {"build", source, "-o", built, "--shutter", "0.2:0.9"};
  expect_exit(run_shoal(pictures.folder, join(build, {"--treelet-size", "8K"})), 0);
  const auto render = [&](const std::string& name, const std::vector<std::string>& options) {
    return pictures.render(name, join(options, {"--bounces", "4", "--spp", "4"}), "cave.shoal");
  };
  const std::vector<float> picture = render("blurred", {"--order", "depth-first", "--threads", "1"});
  for (const char* order : {"queued", "depth-first", "sorted", "hybrid", "auto"}) {
    for (const char* threads : {"1", "3"}) {
      EXPECT_EQ(render(order, {"--order", order, "--threads", threads}), picture) << order << " " << threads;
    }
    if (std::string_view(order) == "hybrid") continue;  // keeps all in memory
    EXPECT_EQ(render(order, {"--order", order, "--threads", "3", "--page-cache", "200K"}), picture) << order;
  }
  expect_exit(run_shoal(pictures.folder, join(build, {"--treelet-size", "64K"})), 0);
  EXPECT_EQ(render("larger", {"--threads", "2"}), picture);
}

/// A lamp that goes from the left to the right above a floor in a second, and another one, out of sight, so that it is
/// an instance where it stands still, too.
WrittenScene lamp_above_floor() {
  WrittenScene scene;
  scene.json["materials"] = {{{"pbrMetallicRoughness", {{"metallicFactor", 0}}}}, {{"emissiveFactor", {1, 1, 1}}}};
  const uint32_t floor = scene.add_floats(3, {-4, -1, -4, 4, -1, -4, 0, -1, 6});
  const uint32_t lamp = scene.add_floats(3, {-0.5f, 0.5f, 0, 0.5f, 0.5f, 0, 0, -0.2f, 0});
  scene.add_node({{"mesh", scene.add_mesh({{"attributes", {{"POSITION", floor}}}, {"material", 0}})}});
  const uint32_t mesh = scene.add_mesh({{"attributes", {{"POSITION", lamp}}}, {"material", 1}});
  scene.add_node({{"mesh", mesh}});
  scene.add_node({{"mesh", mesh}, {"translation", {0, 0, 400}}});
  scene.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.6}, {"znear", 0.1}}}}};
  scene.add_node({{"camera", 0}, {"translation", {0, 0, 5}}});
  const uint32_t input = scene.add_floats(1, {0, 1}), output = scene.add_floats(3, {-1, 0, 0, 1.5f, 0, 0});
  scene.json["animations"] = {{{"channels", {{{"sampler", 0}, {"target", {{"node", 1}, {"path", "translation"}}}}}},
                               {"samplers", {{{"input", input}, {"output", output}}}}}};
  return scene;
}

TEST(Shutter, ALampThatMovesGivesTheLightOfItsStillPictures) {
  const Pictures pictures;
  save(lamp_above_floor(), pictures.folder / "lamp");
  const auto light = [&](const std::vector<std::string>& options) {
    const std::vector<float> picture = pictures.render(
        "lamp", join(options, {"--environment", "constant:0,0,0", "--bounces", "2"}), "lamp/scene.gltf");
    double sum = 0;
    for (size_t i = 48 * 32; i < picture.size(); ++i) sum += picture[i];
    return sum / static_cast<double>(picture.size());
  };
  double still = 0;
  for (int i = 0; i < 16; ++i) still += light({"--time", fmt::format("{}", (i + 0.5) / 16), "--spp", "32"}) / 16;
  EXPECT_NEAR(light({"--shutter", "0:1", "--spp", "512"}), still, 0.02 * still);
}

TEST(Shutter, ForcedOffEverythingStandsAsInTheMiddleAndForcedOnNothingChanges) {
  const Pictures pictures;
  WrittenScene scene = lamp_above_floor();
  nlohmann::json& channels = scene.json["animations"][0]["channels"];
  channels.push_back(channels[0]);
  channels[1]["target"]["node"] = 3;  // the camera goes the same way, from where it is now
  scene.json["animations"][0]["samplers"].push_back(scene.json["animations"][0]["samplers"][0]);
  scene.json["animations"][0]["samplers"][1]["output"] = scene.add_floats(3, {-1, 0, 5, 2, 0, 5});
  channels[1]["sampler"] = 1;
  save(scene, pictures.folder / "lamp");
  const auto render = [&](const std::vector<std::string>& options) {
    return pictures.render("lamp", join(options, {"--spp", "4"}), "lamp/scene.gltf");
  };
  const std::vector<float> still = render({"--time", "0.5"}), blurred = render({"--shutter", "0:1"});
  EXPECT_NE(blurred, still);
  EXPECT_EQ(render({"--shutter", "0:1", "--effects=-motion"}), still);
  EXPECT_EQ(render({"--shutter", "0:1", "--effects=+motion"}), blurred);
  for (const char* choice : {"--effects=-motion", "--effects=+motion"}) {
    EXPECT_EQ(render({"--time", "0.5", choice}), still) << choice;
  }
}

TEST(Shutter, ThePlanOfEffectsSaysHowManyNodesMove) {
  const Pictures pictures;
  const auto info = [&](const std::string& name, const std::vector<std::string>& options) {
    const std::string built = pictures.folder / name;
    const std::vector<std::string> build = {"build", pictures.folder / "scene/scene.gltf", "-o", built};
    expect_exit(run_shoal(pictures.folder, join(build, options)), 0);
    return run_shoal(pictures.folder, {"info", built}).out;
  };
  EXPECT_THAT(info("blurred.shoal", {"--shutter", "0:0.01"}),
              ::testing::HasSubstr("motion                on   1 node moves while the shutter is open\n"));
  EXPECT_THAT(info("still.shoal", {}),
              ::testing::HasSubstr("motion                off  no node moves while the shutter is open (--shutter of"));
}

TEST(Shutter, ABuiltSceneKeepsItsShutter) {
  const Pictures pictures;
  expect_exit(run_shoal(pictures.folder, {"build", pictures.folder / "scene/scene.gltf", "-o",
                                          pictures.folder / "blurred.shoal", "--shutter", "0:0.01"}), 0);
  EXPECT_EQ(pictures.render("kept", {}, "blurred.shoal"), pictures.render("direct", {"--shutter", "0:0.01"}));
  expect_error(pictures.run("wrong", {"--shutter", "0:0.02"}, "blurred.shoal"), 2, {"with a shutter of [0.0,0.01]"});
  expect_error(pictures.run("wrong", {"--time", "0"}, "blurred.shoal"), 2, {"--shutter"});
  for (const char* wrong : {"", "1", "0:", ":1", "1:0", "1:1", "a:b", "0:1:2", "0:nan"}) {
    expect_exit(pictures.run("wrong", {"--shutter", wrong}), 2);
  }
}

}  // namespace
}  // namespace shoal::testing
