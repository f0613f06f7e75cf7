// Every effect of a whole scene or picture: forced off, the picture is to the bit that of the same scene without it,
// which is another one; forced on, and forced either way where nothing calls for it, nothing changes; and the plan says
// who calls for it.
#include <gtest/gtest.h>

#include <functional>

#include "engine/effects.h"
#include "engine/render_report.h"
#include "tests/support/cube_scene.h"

namespace shoal::testing {
namespace {

using Change = std::function<void(CubeScene&)>;

/// The cube's scene in two versions, of which only the first calls for the effect.
struct SceneCase {
  std::string name;
  Change with, without = [](CubeScene&) {};
};

Json& pbr(CubeScene& cube, size_t material) {
  Json& m = cube.scene.json["materials"][material];
  if (!m.contains("pbrMetallicRoughness")) m["pbrMetallicRoughness"] = Json::object();
  return m["pbrMetallicRoughness"];
}

void use_extension(CubeScene& cube, const char* name) { cube.scene.json["extensionsUsed"].push_back(name); }

void add_textures(CubeScene& cube) {
  Json& m = cube.scene.json["materials"][0];
  m["normalTexture"] = {{"index", cube.texture}};
  m["extensions"]["KHR_materials_clearcoat"] = {{"clearcoatFactor", 0.5},
                                                {"clearcoatTexture", {{"index", cube.texture}}}};
  pbr(cube, 0)["baseColorTexture"] = {{"index", cube.texture}};
  pbr(cube, 0)["metallicRoughnessTexture"] = {{"index", cube.texture}};
  use_extension(cube, "KHR_materials_clearcoat");
}

void add_bare_coat(CubeScene& cube) {
  cube.scene.json["materials"][0]["extensions"]["KHR_materials_clearcoat"] = {{"clearcoatFactor", 0.5}};
  use_extension(cube, "KHR_materials_clearcoat");
}

void make_matte(CubeScene& cube) {
  for (Json& m : cube.scene.json["materials"]) {
    m["pbrMetallicRoughness"]["metallicFactor"] = 0;
    m["extensions"]["KHR_materials_specular"] = {{"specularFactor", 0}};
  }
  use_extension(cube, "KHR_materials_specular");
}

void put_out_lamp(CubeScene& cube) { cube.scene.json["materials"][1].erase("emissiveFactor"); }

void add_lights(CubeScene& cube) {
  use_extension(cube, "KHR_lights_punctual");
  cube.scene.json["extensions"]["KHR_lights_punctual"]["lights"] = {
      {{"type", "point"}, {"name", "bulb"}, {"intensity", 30}}, {{"type", "directional"}, {"intensity", 2}}};
  cube.scene.add_node({{"translation", {2, 2, 2}}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  cube.scene.add_node({{"extensions", {{"KHR_lights_punctual", {{"light", 1}}}}}});
}

void add_vertex_colors(CubeScene& cube) {
  std::vector<float> colors;
  for (int i = 0; i < 36; ++i) colors.insert(colors.end(), {0.2f + 0.1f * static_cast<float>(i % 6), 0.5f, 0.3f});
  Json& attributes = cube.scene.json["meshes"][0]["primitives"][0]["attributes"];
  attributes["COLOR_0"] = cube.scene.add_floats(3, colors);
}

std::vector<SceneCase> scene_cases() {
  const auto covered = [](const char* mode) {
    return [mode](CubeScene& cube) {
      cube.scene.json["materials"][0]["alphaMode"] = mode;
      pbr(cube, 0)["baseColorTexture"] = {{"index", cube.texture}};
    };
  };
  const auto no_sky = [](CubeScene& cube) { cube.environment = {}; };
  const auto open_lens = [](CubeScene& cube) {
    cube.lens.aperture = 0.4f, cube.lens.focus_distance = 4;
    cube.lens.distortion = {DistortionModel::kRadial, {0.5}};
  };
  return {{"textures", add_textures, add_bare_coat},
          {"reflection", [](CubeScene& cube) { pbr(cube, 0)["roughnessFactor"] = 0.2; }, make_matte},
          {"emission", [](CubeScene&) {}, put_out_lamp},
          {"punctual-lights", add_lights},
          {"environment", [](CubeScene&) {}, no_sky},
          {"vertex-colors", add_vertex_colors},
          {"coverage", covered("MASK"), covered("OPAQUE")},
          {"coverage", covered("BLEND"), covered("OPAQUE")},
          {"lens", open_lens}};
}

struct ChangedCube : CubeScene {
  explicit ChangedCube(const Change& change)
      : CubeScene(Json{{"name", "subject"}, {"pbrMetallicRoughness", {{"metallicFactor", 0.5}}}}) {
    change(*this);
  }
};

ShadingOptions with_effects(const std::string& text) {
  ShadingOptions options;
  options.effects = parse_effects(text).value();
  return options;
}

TEST(SceneEffects, ForcedOffAPictureIsThatOfTheSceneWithoutThem) {
  for (const SceneCase& c : scene_cases()) {
    ChangedCube with(c.with), without(c.without);
    const std::vector<float> picture = without.picture({});
    EXPECT_NE(with.picture({}), picture) << c.name;
    EXPECT_EQ(with.picture(with_effects("-" + c.name)), picture) << c.name;
  }
}

TEST(SceneEffects, ForcedOnTheyChangeNothingAndForcedOffNothingWhereNothingCallsForThem) {
  for (const SceneCase& c : scene_cases()) {
    ChangedCube with(c.with), without(c.without);
    EXPECT_EQ(with.picture(with_effects("+" + c.name)), with.picture({})) << c.name;
    const std::vector<float> picture = without.picture({});
    EXPECT_EQ(without.picture(with_effects("+" + c.name)), picture) << c.name;
    EXPECT_EQ(without.picture(with_effects("-" + c.name)), picture) << c.name;
  }
}

TEST(SceneEffects, AllTogetherForcedOnChangeNothing) {
  ChangedCube cube([](CubeScene& c) {
    add_textures(c), add_lights(c), add_vertex_colors(c);
    c.scene.json["materials"][0]["alphaMode"] = "BLEND";
    c.lens.aperture = 0.2f, c.lens.focus_distance = 5;
  });
  EXPECT_EQ(cube.picture(with_effects("all")), cube.picture({}));
}

TEST(SceneEffects, WithoutTexturesNoTileIsReadAndNoneIsLookedUp) {
  ChangedCube cube(add_textures);
  EXPECT_GT(cube.rendered({}).counters.texture_loads_count, 0u);
  const RenderResult bare = cube.rendered(with_effects("-textures"));
  EXPECT_EQ(bare.counters.texture_loads_count, 0u);
  EXPECT_EQ(bare.counters.texture_lookups_count, 0u);
}

TEST(SceneEffects, ForcedOffCoverageIsNotTestedAndLightsAreSentNoRays) {
  ChangedCube cube([](CubeScene& c) { c.scene.json["materials"][0]["alphaMode"] = "BLEND", add_vertex_colors(c); });
  pbr(cube, 0)["baseColorFactor"] = {1, 1, 1, 0.5};
  EXPECT_GT(cube.rendered({}).counters.coverage_tests_count, 0u);
  EXPECT_EQ(cube.rendered(with_effects("-coverage")).counters.coverage_tests_count, 0u);
  const auto shadow_rays = [](const RenderResult& r) { return r.counters.of_kind(RayKind::kShadow).rays_traced_count; };
  EXPECT_GT(shadow_rays(cube.rendered({})), 0u);
  EXPECT_EQ(shadow_rays(cube.rendered(with_effects("-emission"))), 0u) << "an even sky is found by bounces";
}

TEST(SceneEffects, ThePlanSaysWhichMaterialLightOrOptionCallsForEach) {
  ChangedCube cube([](CubeScene& c) { add_textures(c), add_lights(c), add_vertex_colors(c); });
  cube.scene.save(cube.fs);
  ASSERT_TRUE(build_scene(cube.fs, "scene.gltf", "scene.shoal", {}).ok());
  const auto scene = open_scene(cube.fs, "scene.shoal", ReadMode::kBuffered, {});
  ASSERT_TRUE(scene.ok());
  PictureOptions picture;
  const auto plan = [&](const char* choice) {
    return effects_plan_text(effects_plan(scene.value(), parse_effects(choice).value(), effect_askers(picture)));
  };
  const auto expect = [](const std::string& text, const char* line) {
    EXPECT_NE(text.find(std::string(line) + "\n"), std::string::npos) << text << line;
  };
  std::string text = plan("-emission");
  expect(text, "reflection            on   3 materials, first \"floor\"");
  expect(text, "emission              off  1 material, first \"lamp\"; forced off");
  expect(text, "coverage              off  no material calls for it");
  expect(text, "vertex-colors         on   1 material, first \"subject\"");
  expect(text, "environment           off  no option asks for it: --environment would");
  expect(text, "lens                  off  no option asks for it: --aperture or --distortion would");
  picture.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(1), {}};
  picture.lens.f_stop = 2.8f;
  text = plan("-lens,+coverage");
  expect(text, "coverage              on   no material calls for it; forced on");
  expect(text, "environment           on   --environment asks for it");
  expect(text, "lens                  off  --aperture asks for it; forced off");
  picture.shading.environment.fallback = true;
  picture.lens.distortion.model = DistortionModel::kBrown;
  text = plan("");
  expect(text, "environment           on   a scene without light asks for it");
  expect(text, "lens                  on   --aperture with --distortion asks for it");
}

}  // namespace
}  // namespace shoal::testing
