// Every effect of materials: a scene made for it, where forcing it off changes the picture; forcing it on never
// does; and the plan says what is on and why.
#include "engine/effects.h"

#include <gtest/gtest.h>

#include "tests/support/cube_scene.h"

namespace shoal::testing {
namespace {

struct EffectCase {
  std::string name;
  Json material;
};

Json extension(const char* name, const Json& value) { return {{"extensions", {{name, value}}}}; }

std::vector<EffectCase> effect_cases() {
  const Json plain = {{"baseColorFactor", {0.8, 0.4, 0.2, 1}}, {"metallicFactor", 0}, {"roughnessFactor", 0.3}};
  const Json metal = {{"baseColorFactor", {0.8, 0.6, 0.4, 1}}, {"metallicFactor", 1}, {"roughnessFactor", 0.4}};
  std::vector<EffectCase> cases;
  const auto add = [&](const char* name, const Json& pbr, Json material) {
    material["name"] = "subject";
    material["pbrMetallicRoughness"] = pbr;
    cases.push_back({name, material});
  };
  const Json glass = {
      {"KHR_materials_transmission", {{"transmissionFactor", 1}}},
      {"KHR_materials_volume",
       {{"thicknessFactor", 1}, {"attenuationDistance", 0.5}, {"attenuationColor", {0.9, 0.5, 0.2}}}}};
  Json prism = glass;
  prism["KHR_materials_dispersion"] = {{"dispersion", 5}};
  add("unlit", plain, extension("KHR_materials_unlit", Json::object()));
  add("transmission", plain, extension("KHR_materials_transmission", {{"transmissionFactor", 0.8}}));
  add("volume", plain, {{"extensions", glass}});
  add("dispersion", plain, {{"extensions", prism}});
  add("diffuse-transmission", plain,
      extension("KHR_materials_diffuse_transmission", {{"diffuseTransmissionFactor", 0.7}}));
  add("clearcoat", metal, extension("KHR_materials_clearcoat", {{"clearcoatFactor", 1}}));
  add("sheen", plain,
      extension("KHR_materials_sheen", {{"sheenColorFactor", {0.2, 0.9, 0.9}}, {"sheenRoughnessFactor", 0.5}}));
  add("anisotropy", metal, extension("KHR_materials_anisotropy", {{"anisotropyStrength", 0.9}}));
  add("iridescence", metal,
      extension("KHR_materials_iridescence", {{"iridescenceFactor", 1}, {"iridescenceThicknessMaximum", 500}}));
  add("normal-map", plain, {{"normalTexture", {{"index", 0}}}});
  Json moved = plain;
  moved["baseColorTexture"] = {
      {"index", 0}, {"extensions", {{"KHR_texture_transform", {{"offset", {0.3, 0.1}}, {"rotation", 0.5}}}}}};
  add("texture-transform", moved, Json::object());
  return cases;
}

ShadingOptions with_effects(const std::string& text) {
  ShadingOptions options;
  const auto choice = parse_effects(text);
  EXPECT_TRUE(choice.ok()) << choice.error().message;
  if (choice.ok()) options.effects = choice.value();
  return options;
}

TEST(Effects, ForcingOneOffChangesTheSceneThatIsMadeForItAndForcingOnNeverDoes) {
  for (const EffectCase& c : effect_cases()) {
    CubeScene cube(c.material);
    const std::vector<float> whole = cube.picture(with_effects(""));
    EXPECT_EQ(cube.picture(with_effects("+" + c.name)), whole) << c.name;
    EXPECT_NE(cube.picture(with_effects("-" + c.name)), whole) << c.name;
  }
}

TEST(Effects, ForcingAllOnChangesNoMaterialWhateverItHasAlready) {
  // The layers of all cases but the unlit one on one cube: a metal in places, glass, coat and sheen elsewhere.
  Json everything = {{"name", "everything"}, {"extensions", Json::object()}};
  for (const EffectCase& c : effect_cases()) {
    const bool layers = c.name != "unlit" && c.material.contains("extensions");
    if (layers) everything["extensions"].update(c.material["extensions"]);
    if (c.name == "texture-transform") everything["pbrMetallicRoughness"] = c.material["pbrMetallicRoughness"];
  }
  everything["pbrMetallicRoughness"]["metallicFactor"] = 0.5;
  everything["normalTexture"] = {{"index", 0}};
  CubeScene cube(everything);
  const std::vector<float> whole = cube.picture(with_effects(""));
  EXPECT_EQ(cube.picture(with_effects("all")), whole);
  EXPECT_NE(cube.picture(with_effects("-clearcoat,-sheen")), whole);
}

TEST(Effects, ForcingAnythingOffOrOnLeavesAPlainSceneAsItIs) {
  CubeScene cube(
      Json{{"name", "plain"}, {"pbrMetallicRoughness", {{"metallicFactor", 0.5}, {"roughnessFactor", 0.3}}}});
  const std::vector<float> whole = cube.picture(with_effects(""));
  EXPECT_EQ(cube.picture(with_effects("-all,+reflection,+emission,+environment")), whole);
  EXPECT_EQ(cube.picture(with_effects("all")), whole);
  for (const EffectCase& c : effect_cases()) {
    EXPECT_EQ(cube.picture(with_effects("+" + c.name)), whole) << c.name;
    EXPECT_EQ(cube.picture(with_effects("-" + c.name)), whole) << c.name;
  }
}

TEST(Effects, ExtensionsThatChangeNothingAskForNothing) {
  for (const Json& extensions : {Json{{"KHR_materials_clearcoat", {{"clearcoatRoughnessFactor", 0.5}}}},
                                 Json{{"KHR_materials_sheen", {{"sheenRoughnessFactor", 0.5}}}},
                                 Json{{"KHR_materials_volume", {{"thicknessFactor", 1}}}},
                                 Json{{"KHR_materials_dispersion", {{"dispersion", 1}}}},
                                 Json{{"KHR_materials_iridescence", {{"iridescenceIor", 1.8}}}}}) {
    CubeScene cube(Json{{"extensions", extensions}});
    cube.scene.save(cube.fs);
    ASSERT_TRUE(build_scene(cube.fs, "scene.gltf", "scene.shoal", {}).ok());
    const auto scene = open_scene(cube.fs, "scene.shoal", ReadMode::kBuffered, {});
    ASSERT_TRUE(scene.ok());
    EXPECT_TRUE(scene.value().material_layers.empty()) << extensions;
    EXPECT_EQ(scene.value().materials[0].effects, 0u) << extensions;
  }
}

TEST(Effects, ThePlanSaysWhatIsOnHowManyMaterialsCallForItAndWhichIsFirst) {
  CubeScene cube(
      Json{{"name", "velvet"}, {"extensions", {{"KHR_materials_sheen", {{"sheenColorFactor", {1, 1, 1}}}}}}});
  cube.scene.save(cube.fs);
  ASSERT_TRUE(build_scene(cube.fs, "scene.gltf", "scene.shoal", {}).ok());
  const auto scene = open_scene(cube.fs, "scene.shoal", ReadMode::kBuffered, {});
  ASSERT_TRUE(scene.ok());
  const auto state = [&](const std::string& text, std::string_view name) {
    for (const EffectState& e : effects_plan(scene.value(), parse_effects(text).value())) {
      if (e.name == name) return e;
    }
    ADD_FAILURE() << name;
    return EffectState{};
  };
  EXPECT_TRUE(state("", "sheen").on);
  EXPECT_EQ(state("", "sheen").callers_count, 1u);
  EXPECT_EQ(state("", "sheen").first_caller, "velvet");
  EXPECT_TRUE(state("", "emission").on);
  EXPECT_FALSE(state("", "clearcoat").on);
  EXPECT_TRUE(state("+clearcoat", "clearcoat").on && state("+clearcoat", "clearcoat").forced);
  EXPECT_FALSE(state("-sheen", "sheen").on);
  EXPECT_FALSE(state("", "textures").on) << "no material that is used has one";
  EXPECT_FALSE(state("", "punctual-lights").on);
  EXPECT_FALSE(state("", "instance-transforms").on);
  EXPECT_FALSE(state("", "motion").on);
  const std::string text = effects_plan_text(effects_plan(scene.value(), {}));
  EXPECT_NE(text.find("sheen                 on   1 material, first \"velvet\""), std::string::npos) << text;
  EXPECT_NE(text.find("clearcoat             off  no material calls for it"), std::string::npos) << text;
}

TEST(Effects, ThePlanCountsTexturesLightsAndInstances) {
  CubeScene cube(Json{{"name", "wood"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
  Json& root = cube.scene.json;
  root["extensionsUsed"].push_back("KHR_lights_punctual");
  root["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}, {"name", "bulb"}}};
  for (const float x : {0.0f, 3.0f}) {
    cube.scene.add_node({{"mesh", 0}, {"translation", {x, 0, 1}}});
    cube.scene.add_node({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  }
  cube.scene.save(cube.fs);
  ASSERT_TRUE(build_scene(cube.fs, "scene.gltf", "scene.shoal", {}).ok());
  const auto scene = open_scene(cube.fs, "scene.shoal", ReadMode::kBuffered, {});
  ASSERT_TRUE(scene.ok());
  const std::string text = effects_plan_text(effects_plan(scene.value(), {}));
  EXPECT_NE(text.find("textures              on   1 material, first \"wood\""), std::string::npos) << text;
  EXPECT_NE(text.find("punctual-lights       on   2 lights, first \"bulb\""), std::string::npos) << text;
  EXPECT_NE(text.find("instance-transforms   on   "), std::string::npos) << text;
  EXPECT_NE(text.find("; cannot be forced"), std::string::npos) << text;
  const Json list = Json::parse(effects_plan_json(effects_plan(scene.value(), {})));
  EXPECT_EQ(list.size(), effects_plan(scene.value(), {}).size());
  EXPECT_EQ(list[3]["name"], "textures");
  EXPECT_EQ(list[3]["callers_count"], 1);
}

TEST(Effects, TheChoiceIsReadFromLeftToRightAndWrongNamesAreRefused) {
  EXPECT_EQ(parse_effects("").value().off, 0u);
  EXPECT_EQ(effects_text(parse_effects("all,-sheen,+sheen,-clearcoat").value()).find("clearcoat"),
            effects_text(parse_effects("all,-clearcoat").value()).find("clearcoat"));
  EXPECT_EQ(parse_effects("-all,+volume").value().on, uint32_t{kEffectVolume});
  const uint32_t all = kAllMaterialEffects | kAllSceneEffects;
  EXPECT_EQ(parse_effects("-all,+volume").value().off, all & ~uint32_t{kEffectVolume});
  for (const char* wrong : {"-", "sheen", "+glitter", "-sheen,,+volume", "none", "-instance-transforms"}) {
    const auto choice = parse_effects(wrong);
    ASSERT_FALSE(choice.ok()) << wrong;
    EXPECT_EQ(choice.error().code, ErrorCode::kUsage);
    EXPECT_NE(choice.error().message.find("clearcoat"), std::string::npos);
  }
}

}  // namespace
}  // namespace shoal::testing
