// Extensions of glTF materials to rows of layers, texture slots and transforms; variants; through a whole build.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/build_record.h"
#include "tests/engine/built_scene.h"

namespace shoal::testing {
namespace {

using Json = nlohmann::json;

struct Written {
  MemoryFileSystem fs;
  WrittenScene scene;
  uint32_t texture = 0;

  explicit Written(const Json& materials) {
    texture = scene.add_texture(fs, 2, 2, std::vector<uint8_t>(16, 200));
    scene.json["materials"] = materials;
    const Json attributes = {{"POSITION", scene.add_floats(3, {0, 0, 0, 1, 0, 0, 0, 1, 0})},
                             {"TEXCOORD_0", scene.add_floats(2, {0, 0, 1, 0, 0, 1})},
                             {"TEXCOORD_1", scene.add_floats(2, {0, 0, 2, 0, 0, 2})}};
    Json primitives = Json::array();
    for (size_t i = 0; i < materials.size(); ++i)
      primitives.push_back({{"attributes", attributes}, {"material", i}});
    const uint32_t mesh = scene.add_mesh(primitives[0]);
    scene.json["meshes"][mesh]["primitives"] = primitives;
    scene.add_node({{"mesh", mesh}});
  }
  Scene build(const SceneBuildOptions& options = {}) {
    scene.save(fs);
    return build_and_open(fs, options).scene;
  }
};

Json with(const char* name, const Json& value) { return {{"extensions", {{name, value}}}}; }

TEST(ConvertLayers, PlainMaterialsHaveNoRow) {
  const Scene scene = Written({Json::object(), {{"emissiveFactor", {1, 1, 1}}}}).build();
  EXPECT_TRUE(scene.material_layers.empty());
  EXPECT_TRUE(scene.texture_transforms.empty());
  EXPECT_EQ(scene.materials[0].effects, 0u);
  EXPECT_EQ(scene.materials[0].layers, kNoIndex);
}

TEST(ConvertLayers, EachExtensionHasItsBitAndItsValues) {
  const Json volume = {{"KHR_materials_transmission", {{"transmissionFactor", 0.5}}},
                       {"KHR_materials_volume",
                        {{"thicknessFactor", 2}, {"attenuationDistance", 4}, {"attenuationColor", {0.5, 1, 0.25}}}},
                       {"KHR_materials_ior", {{"ior", 1.7}}},
                       {"KHR_materials_dispersion", {{"dispersion", 0.5}}}};
  const Scene scene =
      Written({with("KHR_materials_clearcoat", {{"clearcoatFactor", 0.5}, {"clearcoatRoughnessFactor", 0.25}}),
               with("KHR_materials_sheen", {{"sheenColorFactor", {0, 0.5, 1}}, {"sheenRoughnessFactor", 0.75}}),
               with("KHR_materials_anisotropy", {{"anisotropyStrength", 0.5}, {"anisotropyRotation", M_PI / 2}}),
               with("KHR_materials_iridescence", {{"iridescenceFactor", 1}}),
               with("KHR_materials_diffuse_transmission", {{"diffuseTransmissionFactor", 0.25}}),
               {{"pbrMetallicRoughness", {{"metallicFactor", 0}}}, {"extensions", volume}},
               with("KHR_materials_unlit", Json::object())})
          .build();
  const auto row = [&](size_t i) { return scene.material_layers.at(scene.materials[i].layers); };
  EXPECT_EQ(scene.materials[0].effects, uint32_t{kEffectClearcoat});
  EXPECT_EQ(row(0).clearcoat, 0.5f);
  EXPECT_EQ(row(0).clearcoat_roughness, 0.25f);
  EXPECT_EQ(scene.materials[1].effects, uint32_t{kEffectSheen});
  EXPECT_EQ(row(1).sheen_color[1], 0.5f);
  EXPECT_EQ(row(1).sheen_roughness, 0.75f);
  EXPECT_EQ(scene.materials[2].effects, uint32_t{kEffectAnisotropy});
  EXPECT_NEAR(row(2).anisotropy_sin, 1, 1e-6);
  EXPECT_NEAR(row(2).anisotropy_cos, 0, 1e-6);
  EXPECT_EQ(scene.materials[3].effects, uint32_t{kEffectIridescence});
  EXPECT_EQ(row(3).iridescence_ior, 1.3f);
  EXPECT_EQ(row(3).film_minimum, 100);
  EXPECT_EQ(row(3).film_maximum, 400);
  EXPECT_EQ(scene.materials[4].effects, 0u) << "a metal lets nothing through";
  EXPECT_EQ(scene.materials[5].effects, uint32_t{kEffectTransmission | kEffectVolume | kEffectDispersion});
  EXPECT_EQ(row(5).ior, 1.7f);
  EXPECT_NEAR(row(5).absorption[0], -0.25f, 1e-6f);  // a half in four units
  EXPECT_EQ(row(5).absorption[1], 0);
  EXPECT_NEAR(row(5).absorption[2], -0.5f, 1e-6f);
  EXPECT_EQ(scene.materials[6].effects, uint32_t{kEffectUnlit});
  EXPECT_EQ(scene.material_layers.size(), 5u);
}

TEST(ConvertLayers, TexturesOfLayersAreStoredOnceWithTheirEncodingAndUvSet) {
  const Json slot = {{"index", 0}, {"texCoord", 1}};
  const Scene scene =
      Written({with("KHR_materials_clearcoat", {{"clearcoatFactor", 1}, {"clearcoatTexture", slot}}),
               with("KHR_materials_sheen", {{"sheenColorFactor", {1, 1, 1}}, {"sheenColorTexture", slot}}),
               with("KHR_materials_clearcoat", {{"clearcoatFactor", 0}, {"clearcoatTexture", slot}})})
          .build();
  const MaterialLayers& coat = scene.material_layers.at(0);
  const MaterialLayers& sheen = scene.material_layers.at(1);
  ASSERT_EQ(scene.textures.size(), 2u);
  EXPECT_EQ(scene.textures[coat.clearcoat_texture.texture].srgb, 0);
  EXPECT_EQ(scene.textures[sheen.sheen_color_texture.texture].srgb, 1);
  EXPECT_EQ(coat.clearcoat_texture.uv_set, 0u);  // the only set of its material
  EXPECT_EQ(scene.material_layers.size(), 2u) << "a factor of 0 silences its texture";
}

TEST(ConvertLayers, TextureTransformsScaleTurnAndMoveAndAreStoredOnce) {
  const auto moved = [](const Json& transform) {
    return Json{{"pbrMetallicRoughness",
                 {{"baseColorTexture", {{"index", 0}, {"extensions", {{"KHR_texture_transform", transform}}}}}}}};
  };
  // The extension's own example: the lower left quarter, turned clockwise.
  const Json quarter = {{"offset", {0, 1}}, {"rotation", M_PI / 2}, {"scale", {0.5, 0.5}}};
  const Scene scene =
      Written({moved(quarter), moved(quarter), moved({{"offset", {0, 0}}}), moved({{"texCoord", 1}})}).build();
  ASSERT_EQ(scene.texture_transforms.size(), 1u);
  EXPECT_EQ(scene.materials[0].base_color_texture.transform, 1);
  EXPECT_EQ(scene.materials[1].base_color_texture.transform, 1);
  EXPECT_EQ(scene.materials[2].base_color_texture.transform, 0);
  EXPECT_EQ(scene.materials[0].effects, uint32_t{kEffectTextureTransform});
  const float* m = scene.texture_transforms[0].m;
  for (const float u : {0.0f, 1.0f}) {
    for (const float v : {0.0f, 1.0f}) {
      const float x = m[0] * u + m[1] * v + m[2], y = m[3] * u + m[4] * v + m[5];
      EXPECT_NEAR(x, 0.5f * v, 1e-6f);
      EXPECT_NEAR(y, 1 - 0.5f * u, 1e-6f);
    }
  }
}

TEST(ConvertLayers, AVariantChangesTheMaterialsOfItsPrimitivesAndStaysInTheRecord) {
  Written written({{{"name", "red"}}, {{"name", "blue"}, {"emissiveFactor", {0, 0, 1}}}});
  Json& primitives = written.scene.json["meshes"][0]["primitives"];
  primitives.erase(1);
  primitives[0]["extensions"]["KHR_materials_variants"]["mappings"] = {{{"material", 1}, {"variants", {0, 2}}},
                                                                       {{"material", 0}, {"variants", {1}}}};
  written.scene.json["extensions"]["KHR_materials_variants"]["variants"] = {
      {{"name", "night"}}, {{"name", "day"}}, {{"name", "late night"}}};
  written.scene.json["extensionsUsed"] = written.scene.json["extensionsRequired"] = {"KHR_materials_variants"};
  EXPECT_EQ(written.build().emitters.size(), 0u);
  SceneBuildOptions options;
  options.variant = "late night";
  const Scene night = written.build(options);
  EXPECT_EQ(night.emitters.size(), 1u);
  EXPECT_NE(night.build_record.find("\"variant\": \"late night\""), std::string::npos) << night.build_record;
  options.variant = "noon";
  const std::string message = build_error(written.fs, ErrorCode::kUsage, options);
  EXPECT_NE(message.find("no variant 'noon'"), std::string::npos) << message;
  EXPECT_NE(message.find("night, day, late night"), std::string::npos) << message;
  auto& variants = written.scene.json["extensions"]["KHR_materials_variants"]["variants"];
  for (int i = 0; i < 110; ++i) variants.push_back({{"name", std::string(200, 'x')}});
  written.scene.save(written.fs);
  const std::string many = build_error(written.fs, ErrorCode::kUsage, options);
  EXPECT_NE(many.find("night, day, late night, xx"), std::string::npos) << many;
  EXPECT_NE(many.find(" and 108 more"), std::string::npos) << many;
  EXPECT_LT(many.size(), 500u);
  const auto plain = build_cache_key(written.fs, "scene.gltf", {});
  options.variant = "day";
  const auto day = build_cache_key(written.fs, "scene.gltf", options);
  ASSERT_TRUE(plain.ok() && day.ok());
  EXPECT_NE(plain.value(), day.value());
}

}  // namespace
}  // namespace shoal::testing
