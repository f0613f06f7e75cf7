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
  scene.root["extensionsUsed"] = {"EXT_texture_avif", "KHR_materials_ior", "ACME_rocket", "EXT_texture_avif"};
  EXPECT_THAT(load(scene).warnings, ElementsAre("ACME_rocket is not known and is ignored",
                                                "EXT_texture_avif is not simulated yet"));
}

TEST(GltfDocument, RefusesARequiredExtensionWithAdvice) {
  GltfScene scene = triangle_scene();
  scene.root["extensionsRequired"] = {"EXT_texture_avif"};
  MemoryFileSystem fs;
  const auto document = load_document(fs, scene.put(fs));
  ASSERT_FALSE(document.ok());
  EXPECT_EQ(document.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(document.error().message, HasSubstr("EXT_texture_avif"));
  EXPECT_THAT(document.error().message, HasSubstr("gltf-transform png"));
}

TEST(GltfDocument, ATextureIsItsWebpWhereItHasOneAndNeverABasisuImage) {
  GltfScene scene = triangle_scene();
  scene.root["images"].push_back({{"uri", "b.webp"}});
  json& texture = scene.root["textures"][0];
  texture["extensions"]["EXT_texture_webp"]["source"] = 1;
  scene.root["extensionsRequired"] = {"EXT_texture_webp"};
  EXPECT_EQ(load(scene).textures[0].image, 1u);
  texture.erase("source");
  EXPECT_EQ(load(scene).textures[0].image, 1u);
  texture["extensions"] = {{"KHR_texture_basisu", {{"source", 1}}}};
  texture["source"] = 0;
  scene.root["extensionsRequired"] = {"KHR_texture_basisu"};
  EXPECT_EQ(load(scene).textures[0].image, 0u);
  texture.erase("source");
  MemoryFileSystem fs;
  const auto document = load_document(fs, scene.put(fs));
  ASSERT_FALSE(document.ok());
  EXPECT_EQ(document.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(document.error().message, HasSubstr("textures[0]: KHR_texture_basisu is not supported"));
  EXPECT_THAT(document.error().message, HasSubstr("gltf-transform ktxdecompress"));
}

TEST(GltfDocument, InstancesHaveAttributesOfOneLengthAndTheRightShape) {
  GltfScene scene = triangle_scene();
  scene.add_accessor<float>({1, 2, 3, 4, 5, 6}, "VEC3", kFloat, 2);
  scene.add_accessor<float>({0, 0, 0, 1}, "VEC4", kFloat, 1);
  json& attributes = scene.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
  attributes = {{"TRANSLATION", 3}, {"_ID", 4}};
  const Document document = load(scene);
  ASSERT_EQ(document.instancings.size(), 1u);
  EXPECT_EQ(document.instancings.at(0).count, 2u);
  attributes = {{"_ID", 4}};
  EXPECT_TRUE(load(scene).instancings.empty());
  attributes = {{"TRANSLATION", 3}, {"ROTATION", 4}};
  EXPECT_THAT(load_error(scene), HasSubstr("nodes[0].extensions.EXT_mesh_gpu_instancing.attributes.ROTATION: expected"));
  attributes = {{"SCALE", 4}};
  EXPECT_THAT(load_error(scene), HasSubstr("expected an accessor of 3 components"));
}

TEST(GltfDocument, ReadsSkinsMorphTargetsAndAnimations) {
  GltfScene scene = triangle_scene();
  const uint32_t times = scene.add_accessor<float>({0, 1}, "SCALAR", kFloat, 2);
  const uint32_t moves = scene.add_accessor<float>({0, 0, 0, 1, 1, 1}, "VEC3", kFloat, 2);
  scene.root["skins"] = {{{"joints", {1, 0}}}};
  scene.root["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", 0}}, {{"NORMAL", 1}}};
  scene.root["meshes"][0]["weights"] = {0.25, 0.5};
  scene.root["nodes"][0]["weights"] = {1, 2};
  scene.root["nodes"][0]["skin"] = 0;
  scene.root["animations"] = {{{"name", "turn"},
                               {"channels", {{{"sampler", 0}, {"target", {{"node", 1}, {"path", "translation"}}}},
                                             {{"sampler", 0}, {"target", {{"path", "rotation"}}}}}},
                               {"samplers", {{{"input", times}, {"output", moves}, {"interpolation", "STEP"}}}}}};
  const Document document = load(scene);
  EXPECT_THAT(document.skins.at(0).joints, ElementsAre(1, 0));
  EXPECT_EQ(document.nodes[0].skin, 0u);
  EXPECT_THAT(document.meshes[0].weights, ElementsAre(0.25, 0.5));
  EXPECT_EQ(document.meshes[0].primitives[0].targets.at(1).normal, 1u);
  EXPECT_THAT(document.node_weights.at(0), ElementsAre(1, 2));
  ASSERT_EQ(document.animations.at(0).channels.size(), 1u);
  EXPECT_EQ(document.animations[0].name, "turn");
  EXPECT_EQ(document.animations[0].channels[0].interpolation, Interpolation::kStep);
  EXPECT_THAT(document.rest_places.at(1).translation, ElementsAre(1, 2, 3));
  EXPECT_TRUE(document.warnings.empty());
}

TEST(GltfDocument, RefusesMotionOfTheWrongShape) {
  const auto broken = [](const std::string& pointer, const json& value) {
    GltfScene scene = triangle_scene();
    scene.add_accessor<float>({0, 1}, "SCALAR", kFloat, 2);
    scene.add_accessor<float>({0, 0, 0, 1, 1, 1}, "VEC3", kFloat, 2);
    scene.root["skins"] = {{{"joints", {1, 0}}}};
    scene.root["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", 0}}};
    scene.root["meshes"][0]["weights"] = {0.25};
    scene.root["animations"] = {{{"channels", {{{"sampler", 0}, {"target", {{"node", 1}, {"path", "translation"}}}}}},
                                 {"samplers", {{{"input", 3}, {"output", 4}}}}}};
    EXPECT_EQ(load_error(scene), "");
    scene.root[json::json_pointer(pointer)] = value;
    return load_error(scene);
  };
  EXPECT_THAT(broken("/skins/0/joints", json::array()), HasSubstr("skins[0].joints: expected one node at least"));
  EXPECT_THAT(broken("/skins/0/joints/0", 9), HasSubstr("skins[0].joints[0]"));
  EXPECT_THAT(broken("/skins/0/inverseBindMatrices", 0), HasSubstr("2 matrices of 4 x 4 floats"));
  EXPECT_THAT(broken("/meshes/0/weights", {1, 2}), HasSubstr("meshes[0].weights: expected 1, one a morph target"));
  EXPECT_THAT(broken("/meshes/0/weights/0", "x"), HasSubstr("meshes[0].weights[0]"));
  EXPECT_THAT(broken("/meshes/0/primitives/0/targets/0/POSITION", 3), HasSubstr("targets[0].POSITION: expected 3"));
}

TEST(GltfDocument, SetsAnimationsOfTheWrongShapeAside) {
  const auto broken = [](const std::string& pointer, const json& value) {
    GltfScene scene = triangle_scene();
    scene.add_accessor<float>({0, 1}, "SCALAR", kFloat, 2);
    scene.add_accessor<float>({0, 0, 0, 1, 1, 1}, "VEC3", kFloat, 2);
    const json whole = {{"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}},
                        {"samplers", {{{"input", 3}, {"output", 4}}}}};
    scene.root["animations"] = {whole, whole};
    scene.root["animations"][0]["channels"][0]["target"]["node"] = 1;
    scene.root[json::json_pointer(pointer)] = value;
    const Document document = load(scene);
    EXPECT_EQ(document.animations.at(1).broken, "");
    EXPECT_EQ(document.animations.at(1).channels.size(), 1u);
    EXPECT_TRUE(document.animations[0].channels.empty());
    EXPECT_EQ(document.warnings.size(), 1u);
    EXPECT_THAT(document.warnings.at(0), HasSubstr("animations[0] cannot be shown: "));
    return document.animations[0].broken;
  };
  const std::string animation = "/animations/0/";
  EXPECT_THAT(broken("/animations/0", 3), HasSubstr("animations[0]: expected an object"));
  EXPECT_THAT(broken(animation + "channels/0/sampler", 1), HasSubstr("animations[0].channels[0].sampler"));
  EXPECT_THAT(broken(animation + "channels/0/target/node", 7), HasSubstr("target.node"));
  EXPECT_THAT(broken(animation + "channels/0/target/path", "rotation"), HasSubstr("values of 4 components"));
  EXPECT_THAT(broken(animation + "samplers/0/input", 4), HasSubstr("samplers[0].input: expected times"));
  EXPECT_THAT(broken(animation + "samplers/0/interpolation", "CUBICSPLINE"), HasSubstr("expected 6 values, found 2"));
  EXPECT_THAT(broken(animation + "samplers/0/interpolation", "CUBIC"), HasSubstr("STEP, LINEAR or CUBICSPLINE"));
  EXPECT_THAT(broken("/nodes/1/matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}), HasSubstr("animated node"));
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
