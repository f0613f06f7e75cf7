#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/io/gltf_scene.h"

namespace shoal::gltf {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

GltfScene scene_with(const json& extensions) {
  GltfScene scene = triangle_scene();
  scene.root["materials"][0]["extensions"] = extensions;
  return scene;
}

Document load(const GltfScene& scene) {
  MemoryFileSystem fs;
  auto document = load_document(fs, scene.put(fs));
  EXPECT_TRUE(document.ok()) << document.error().message;
  return std::move(document).value();
}

TEST(GltfMaterialExtensions, HaveTheDefaultsOfTheirSpecifications) {
  const MaterialExtensions m = load(scene_with({{"KHR_materials_transmission", json::object()},
                                                {"KHR_materials_volume", json::object()},
                                                {"KHR_materials_clearcoat", json::object()},
                                                {"KHR_materials_sheen", json::object()},
                                                {"KHR_materials_anisotropy", json::object()},
                                                {"KHR_materials_iridescence", json::object()},
                                                {"KHR_materials_dispersion", json::object()},
                                                {"KHR_materials_diffuse_transmission", json::object()}}))
                                   .materials[0]
                                   .more;
  EXPECT_FALSE(m.unlit);
  EXPECT_EQ(m.transmission, 0);
  EXPECT_FALSE(m.has_volume);
  EXPECT_EQ(m.attenuation_distance, 0);
  EXPECT_THAT(m.attenuation_color, ElementsAre(1, 1, 1));
  EXPECT_EQ(m.clearcoat + m.clearcoat_roughness, 0);
  EXPECT_EQ(m.clearcoat_normal_scale, 1);
  EXPECT_THAT(m.sheen_color, ElementsAre(0, 0, 0));
  EXPECT_EQ(m.sheen_roughness, 0);
  EXPECT_EQ(m.anisotropy + m.anisotropy_rotation, 0);
  EXPECT_EQ(m.iridescence, 0);
  EXPECT_EQ(m.iridescence_ior, 1.3);
  EXPECT_EQ(m.film_minimum, 100);
  EXPECT_EQ(m.film_maximum, 400);
  EXPECT_EQ(m.dispersion, 0);
  EXPECT_EQ(m.diffuse_transmission, 0);
  EXPECT_THAT(m.diffuse_transmission_color, ElementsAre(1, 1, 1));
}

TEST(GltfMaterialExtensions, AreReadWithTheirTextures) {
  const json texture = {{"index", 0}};
  const MaterialExtensions m =
      load(scene_with(
               {{"KHR_materials_unlit", json::object()},
                {"KHR_materials_volume",
                 {{"thicknessFactor", 0.5}, {"attenuationDistance", 3}, {"attenuationColor", {0.1, 0.2, 0.3}}}},
                {"KHR_materials_clearcoat",
                 {{"clearcoatFactor", 0.5},
                  {"clearcoatTexture", texture},
                  {"clearcoatNormalTexture", {{"index", 0}, {"scale", 0.25}}}}},
                {"KHR_materials_anisotropy", {{"anisotropyStrength", 0.5}, {"anisotropyTexture", texture}}}}))
          .materials[0]
          .more;
  EXPECT_TRUE(m.unlit && m.has_volume);
  EXPECT_EQ(m.attenuation_distance, 3);
  EXPECT_THAT(m.attenuation_color, ElementsAre(0.1, 0.2, 0.3));
  EXPECT_EQ(m.clearcoat, 0.5);
  EXPECT_EQ(m.clearcoat_normal_scale, 0.25);
  EXPECT_TRUE(m.clearcoat_texture && m.clearcoat_normal_texture && m.anisotropy_texture);
  EXPECT_FALSE(m.clearcoat_roughness_texture || m.sheen_color_texture);
}

TEST(GltfMaterialExtensions, FactorsOutsideTheirRangeAreClampedWithAWarningThatNamesThePlace) {
  const struct {
    json extensions;
    const char* place;
  } cases[] = {
      {{{"KHR_materials_transmission", {{"transmissionFactor", 1.5}}}},
       "KHR_materials_transmission.transmissionFactor"},
      {{{"KHR_materials_clearcoat", {{"clearcoatFactor", -1}}}}, "KHR_materials_clearcoat.clearcoatFactor"},
      {{{"KHR_materials_sheen", {{"sheenColorFactor", {0, 2, 0}}}}}, "KHR_materials_sheen.sheenColorFactor"},
      {{{"KHR_materials_iridescence", {{"iridescenceIor", 0.5}}}}, "KHR_materials_iridescence.iridescenceIor"},
      {{{"KHR_materials_dispersion", {{"dispersion", -2}}}}, "KHR_materials_dispersion.dispersion"},
      {{{"KHR_materials_diffuse_transmission", {{"diffuseTransmissionFactor", 7}}}}, "diffuseTransmissionFactor"},
      {{{"KHR_materials_anisotropy", {{"anisotropyStrength", 2}}}}, "KHR_materials_anisotropy.anisotropyStrength"},
  };
  for (const auto& c : cases) {
    const Document document = load(scene_with(c.extensions));
    ASSERT_EQ(document.warnings.size(), 1u) << c.place;
    EXPECT_THAT(document.warnings[0], AllOf(HasSubstr("materials[0].extensions"), HasSubstr(c.place)));
  }
}

TEST(GltfMaterialExtensions, WhatHasNoMeaningIsAnErrorThatNamesFileAndPlace) {
  const struct {
    json extensions;
    const char* place;
  } cases[] = {
      {{{"KHR_materials_volume", {{"attenuationDistance", 0}}}}, "KHR_materials_volume.attenuationDistance"},
      {{{"KHR_materials_volume", {{"attenuationDistance", -1}}}}, "expected a number above 0"},
      {{{"KHR_materials_clearcoat", {{"clearcoatFactor", "much"}}}}, "clearcoatFactor"},
      {{{"KHR_materials_clearcoat", {{"clearcoatTexture", {{"index", 9}}}}}}, "clearcoatTexture.index"},
      {{{"KHR_materials_sheen", {{"sheenColorFactor", {1, 1}}}}}, "sheenColorFactor"},
      {{{"KHR_materials_sheen", 3}}, "KHR_materials_sheen"},
      {{{"KHR_materials_clearcoat",
         {{"clearcoatTexture", {{"index", 0}, {"extensions", {{"KHR_texture_transform", {{"offset", {1}}}}}}}}}}},
       "KHR_texture_transform.offset"},
  };
  for (const auto& c : cases) {
    EXPECT_THAT(load_error(scene_with(c.extensions)),
                AllOf(HasSubstr("scene.gltf: materials[0]"), HasSubstr(c.place)));
  }
}

TEST(GltfMaterialExtensions, TextureTransformsAreOfEachReferenceAndMayNameAnotherUvSet) {
  GltfScene scene = triangle_scene();
  scene.root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {
      {"index", 0},
      {"texCoord", 1},
      {"extensions",
       {{"KHR_texture_transform",
         {{"offset", {0.5, 0.25}}, {"rotation", 1}, {"scale", {2, 3}}, {"texCoord", 4}}}}}};
  scene.root["materials"][0]["emissiveTexture"] = {{"index", 0}};
  const Material material = load(scene).materials[0];
  ASSERT_TRUE(material.base_color_texture);
  EXPECT_EQ(material.base_color_texture->texcoord, 4u);
  EXPECT_THAT(material.base_color_texture->offset, ElementsAre(0.5, 0.25));
  EXPECT_THAT(material.base_color_texture->scale, ElementsAre(2, 3));
  EXPECT_EQ(material.base_color_texture->rotation, 1);
  EXPECT_TRUE(material.base_color_texture->transformed());
  EXPECT_FALSE(material.emissive_texture->transformed());
}

TEST(GltfMaterialExtensions, VariantMappingsAreCheckedAgainstMaterialsAndVariants) {
  const auto mapped = [](const json& mapping) {
    GltfScene scene = triangle_scene();
    scene.root["extensions"]["KHR_materials_variants"]["variants"] = {{{"name", "a"}}, {{"name", "b"}}};
    scene.root["meshes"][0]["primitives"][0]["extensions"]["KHR_materials_variants"]["mappings"] = {mapping};
    return scene;
  };
  const Document document = load(mapped({{"material", 0}, {"variants", {1}}}));
  EXPECT_THAT(document.variants, ElementsAre("a", "b"));
  EXPECT_THAT(document.meshes[0].primitives[0].variant_materials.at(0).variants, ElementsAre(1u));
  EXPECT_THAT(load_error(mapped({{"material", 9}, {"variants", {1}}})), HasSubstr("mappings[0].material"));
  EXPECT_THAT(load_error(mapped({{"material", 0}, {"variants", {2}}})), HasSubstr("mappings[0].variants[0]"));
}

}  // namespace
}  // namespace shoal::gltf
