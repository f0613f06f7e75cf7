#include "io/gltf_document.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/io/gltf_scene.h"

namespace shoal::gltf {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

Document load(const GltfScene& scene) {
  MemoryFileSystem fs;
  auto document = load_document(fs, scene.put(fs));
  if (document.ok()) return std::move(document).value();
  ADD_FAILURE() << document.error().message;
  return {};
}

TEST(GltfDocument, ReadsATriangleWithEverythingAroundIt) {
  const Document document = load(triangle_scene());
  ASSERT_EQ(document.meshes.size(), 1u);
  const Primitive& primitive = document.meshes[0].primitives.at(0);
  EXPECT_EQ(primitive.attributes.at("POSITION"), 0u);
  EXPECT_EQ(primitive.attributes.at("NORMAL"), 1u);
  EXPECT_EQ(primitive.indices, 2u);
  EXPECT_EQ(primitive.material, 0u);
  EXPECT_EQ(document.folder, "dir");
  EXPECT_EQ(document.buffers.at(0).path, "dir/scene.bin");
  EXPECT_EQ(document.images.at(0).path, "dir/a b.png");
  EXPECT_TRUE(document.samplers.at(0).nearest_magnification);
  EXPECT_EQ(document.samplers.at(0).wrap_s, 33071u);
  EXPECT_EQ(document.samplers.at(0).wrap_t, 10497u);
  EXPECT_EQ(document.materials.at(0).name, "paint");
  EXPECT_EQ(document.materials.at(0).base_color_texture->texcoord, 1u);
  EXPECT_DOUBLE_EQ(document.cameras.at(0).yfov, 0.5);
  EXPECT_EQ(document.cameras.at(0).aspect_ratio, 0);
  EXPECT_THAT(document.roots, ElementsAre(0, 1));
  EXPECT_THAT(document.warnings, IsEmpty());
}

TEST(GltfDocument, ReadsAGlbAsTheSameSceneWithItsBinaryInPlace) {
  const GltfScene scene = triangle_scene();
  MemoryFileSystem fs;
  auto document = load_document(fs, scene.put_glb(fs));
  ASSERT_TRUE(document.ok()) << document.error().message;
  EXPECT_EQ(document.value().buffers.at(0).path, "dir/scene.glb");
  EXPECT_TRUE(document.value().buffers.at(0).embedded.empty());
  EXPECT_THAT(read_all(fs, document.value(), 0), ElementsAre(0, 0, 0, 1, 0, 0, 0, 1, 0));
  EXPECT_THAT(read_triangles(fs, document.value()), ElementsAre(0, 1, 2));
}

TEST(GltfDocument, DecodesBuffersAndImagesInDataUris) {
  GltfScene scene = triangle_scene();
  scene.root["buffers"] = {{{"byteLength", 5}, {"uri", "data:application/octet-stream;base64,aGVsbG8="}}};
  scene.root["images"][0] = {{"uri", "data:image/png;base64,AQID"}};
  scene.root["bufferViews"] = {{{"buffer", 0}, {"byteLength", 5}}};
  scene.root["accessors"] = {
      {{"bufferView", 0}, {"count", 5}, {"type", "SCALAR"}, {"componentType", kUnsignedByte}}};
  scene.root.erase("meshes");
  scene.root["nodes"][0].erase("mesh");
  MemoryFileSystem fs;
  auto document = load_document(fs, scene.put(fs));
  ASSERT_TRUE(document.ok()) << document.error().message;
  EXPECT_THAT(read_all(fs, document.value(), 0), ElementsAre('h', 'e', 'l', 'l', 'o'));
  EXPECT_THAT(document.value().images[0].embedded, ElementsAre(std::byte{1}, std::byte{2}, std::byte{3}));
}

TEST(GltfDocument, ReadsMaterialsWithTheirExtensions) {
  GltfScene scene = triangle_scene();
  scene.root["materials"][0] = {
      {"pbrMetallicRoughness",
       {{"baseColorFactor", {0.1, 0.2, 0.3, 0.4}},
        {"metallicFactor", 0.25},
        {"roughnessFactor", 0.75},
        {"metallicRoughnessTexture", {{"index", 0}}}}},
      {"normalTexture", {{"index", 0}, {"scale", 2}}},
      {"emissiveFactor", {1, 0.5, 0}},
      {"emissiveTexture", {{"index", 0}}},
      {"alphaMode", "MASK"},
      {"alphaCutoff", 0.3},
      {"doubleSided", true},
      {"extensions",
       {{"KHR_materials_emissive_strength", {{"emissiveStrength", 40}}},
        {"KHR_materials_ior", {{"ior", 1.33}}},
        {"KHR_materials_specular",
         {{"specularFactor", 0.5}, {"specularColorFactor", {1, 0.9, 0.8}}, {"specularTexture", {{"index", 0}}}}}}}};
  const Document document = load(scene);
  const Material& material = document.materials.at(0);
  EXPECT_THAT(material.base_color, ElementsAre(0.1, 0.2, 0.3, 0.4));
  EXPECT_EQ(material.metallic, 0.25);
  EXPECT_EQ(material.roughness, 0.75);
  EXPECT_EQ(material.normal_scale, 2);
  EXPECT_THAT(material.emissive, ElementsAre(1, 0.5, 0));
  EXPECT_EQ(material.emissive_strength, 40);
  EXPECT_EQ(material.ior, 1.33);
  EXPECT_EQ(material.specular, 0.5);
  EXPECT_THAT(material.specular_color, ElementsAre(1, 0.9, 0.8));
  EXPECT_EQ(material.alpha_mode, AlphaMode::kMask);
  EXPECT_EQ(material.alpha_cutoff, 0.3);
  EXPECT_TRUE(material.double_sided);
  EXPECT_TRUE(material.metallic_roughness_texture && material.normal_texture && material.emissive_texture &&
              material.specular_texture);
  EXPECT_FALSE(material.base_color_texture || material.specular_color_texture);
}

TEST(GltfDocument, ClampsFactorsOutsideTheirRangeAndSaysSo) {
  GltfScene scene = triangle_scene();
  scene.root["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] = 1.5;
  const Document document = load(scene);
  EXPECT_EQ(document.materials.at(0).metallic, 1);
  EXPECT_THAT(document.warnings, ElementsAre(HasSubstr("materials[0].pbrMetallicRoughness.metallicFactor")));
}

TEST(GltfDocument, ReadsLightsAndCameras) {
  GltfScene scene = triangle_scene();
  scene.root["cameras"].push_back({{"type", "orthographic"}, {"orthographic", {{"xmag", 3}, {"ymag", 4}}}});
  scene.root["extensions"]["KHR_lights_punctual"]["lights"] = {
      {{"type", "spot"}, {"intensity", 7}, {"spot", {{"innerConeAngle", 0.1}, {"outerConeAngle", 0.2}}}},
      {{"type", "directional"}, {"color", {1, 0, 0}}}};
  scene.root["nodes"][0]["extensions"]["KHR_lights_punctual"]["light"] = 1;
  scene.root["extensionsUsed"] = {"KHR_lights_punctual"};
  scene.root["extensionsRequired"] = {"KHR_lights_punctual"};
  const Document document = load(scene);
  EXPECT_FALSE(document.cameras.at(1).perspective);
  EXPECT_EQ(document.cameras[1].ymag, 4);
  EXPECT_EQ(document.lights.at(0).type, LightType::kSpot);
  EXPECT_EQ(document.lights[0].inner_cone, 0.1);
  EXPECT_EQ(document.lights[0].intensity, 7);
  EXPECT_EQ(document.lights.at(1).type, LightType::kDirectional);
  EXPECT_THAT(document.lights[1].color, ElementsAre(1, 0, 0));
  EXPECT_EQ(document.nodes[0].light, 1u);
}

TEST(GltfDocument, WarnsOnceOfEachExtensionThatIsUsedButNotRead) {
  GltfScene scene = triangle_scene();
  scene.root["extensionsUsed"] = {"KHR_texture_basisu", "KHR_materials_ior", "ACME_rocket", "KHR_texture_basisu"};
  EXPECT_THAT(load(scene).warnings, ElementsAre("ACME_rocket is not known and is ignored",
                                                "KHR_texture_basisu is not simulated yet"));
}

TEST(GltfDocument, RefusesARequiredExtensionWithAdvice) {
  GltfScene scene = triangle_scene();
  scene.root["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  MemoryFileSystem fs;
  const auto document = load_document(fs, scene.put(fs));
  ASSERT_FALSE(document.ok());
  EXPECT_EQ(document.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(document.error().message, HasSubstr("KHR_draco_mesh_compression"));
  EXPECT_THAT(document.error().message, HasSubstr("gltf-transform copy"));
}

TEST(GltfDocument, WarnsThatSkinsMorphTargetsAndAnimationsAreNotPosed) {
  GltfScene scene = triangle_scene();
  scene.root["skins"] = {{{"joints", {0}}}};
  scene.root["animations"] = {json::object()};
  scene.root["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", 0}}};
  EXPECT_THAT(load(scene).warnings,
              ElementsAre("skins, morph targets, animations: not posed yet, the rest geometry is used"));
}

TEST(GltfDocument, GivesTheSameHashToTheSameJsonOnly) {
  GltfScene scene = triangle_scene();
  const uint64_t hash = load(scene).content_hash;
  EXPECT_EQ(load(scene).content_hash, hash);
  scene.root["materials"][0]["name"] = "other";
  EXPECT_NE(load(scene).content_hash, hash);
}

TEST(GltfDocument, FailsWithInputWhenThereIsNoFile) {
  MemoryFileSystem fs;
  const auto document = load_document(fs, "nowhere.gltf");
  ASSERT_FALSE(document.ok());
  EXPECT_EQ(document.error().code, ErrorCode::kInput);
}

}  // namespace
}  // namespace shoal::gltf
