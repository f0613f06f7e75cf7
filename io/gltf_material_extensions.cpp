// Texture references with KHR_texture_transform, and the KHR_materials_* extensions of a material. A factor outside
// its range is clamped with a warning that names its place; what has no nearest meaning is an error.
#include <fmt/format.h>

#include "io/gltf_sections.h"

namespace shoal::gltf {

namespace {

constexpr uint64_t kMaxTexcoordSets = 16;
/// Farther apart than any texture repeats in a picture, and still exact to 1e-7 of a texture as a double.
constexpr double kMaxUvFactor = 1e6;
/// Beyond diamond (2.42) and rutile (2.9); KHR_materials_ior asks for no limit, formulas want one.
constexpr double kMaxIor = 1e3;
constexpr double kMaxDispersion = 100;   // an Abbe number of 0.2: no glass is below 9
constexpr double kMaxFilmNanometres = 1e6;
constexpr double kMaxDistance = 1e30;

void read_transform(const JsonNode& texture, TextureInfo& info) {
  const JsonNode node = texture.object("extensions").object("KHR_texture_transform");
  if (!node.present()) return;
  info.offset = node.clamped_numbers<2>("offset", {0, 0}, -kMaxUvFactor, kMaxUvFactor);
  info.scale = node.clamped_numbers<2>("scale", {1, 1}, -kMaxUvFactor, kMaxUvFactor);
  info.rotation = node.clamped("rotation", 0, -1e4, 1e4);  // as far as sines keep their digits
  info.texcoord = static_cast<uint32_t>(node.whole("texCoord", info.texcoord, kMaxTexcoordSets - 1));
}

void read_transmission(const JsonNode& extensions, const Document& document, MaterialExtensions& more) {
  const JsonNode transmission = extensions.object("KHR_materials_transmission");
  more.transmission = transmission.clamped("transmissionFactor", 0, 0, 1);
  more.transmission_texture = read_texture_info(transmission, "transmissionTexture", document);
  const JsonNode volume = extensions.object("KHR_materials_volume");
  // The thickness is for renderers that cannot follow a ray through the volume; 0 says that there is none.
  more.has_volume = volume.clamped("thicknessFactor", 0, 0, kMaxDistance) > 0;
  if (volume.member("attenuationDistance").present()) {
    const double distance = volume.number("attenuationDistance", 0);
    if (!(distance > 0)) volume.fail_at("attenuationDistance", "a number above 0", fmt::format("{}", distance));
    more.attenuation_distance = distance;
  }
  more.attenuation_color = volume.clamped_numbers<3>("attenuationColor", {1, 1, 1}, 0, 1);
  more.dispersion = extensions.object("KHR_materials_dispersion").clamped("dispersion", 0, 0, kMaxDispersion);
  const JsonNode diffuse = extensions.object("KHR_materials_diffuse_transmission");
  more.diffuse_transmission = diffuse.clamped("diffuseTransmissionFactor", 0, 0, 1);
  more.diffuse_transmission_texture = read_texture_info(diffuse, "diffuseTransmissionTexture", document);
  more.diffuse_transmission_color = diffuse.clamped_numbers<3>("diffuseTransmissionColorFactor", {1, 1, 1}, 0, 1);
  more.diffuse_transmission_color_texture = read_texture_info(diffuse, "diffuseTransmissionColorTexture", document);
}

void read_coats(const JsonNode& extensions, const Document& document, MaterialExtensions& more) {
  const JsonNode coat = extensions.object("KHR_materials_clearcoat");
  more.clearcoat = coat.clamped("clearcoatFactor", 0, 0, 1);
  more.clearcoat_texture = read_texture_info(coat, "clearcoatTexture", document);
  more.clearcoat_roughness = coat.clamped("clearcoatRoughnessFactor", 0, 0, 1);
  more.clearcoat_roughness_texture = read_texture_info(coat, "clearcoatRoughnessTexture", document);
  more.clearcoat_normal_texture = read_texture_info(coat, "clearcoatNormalTexture", document);
  more.clearcoat_normal_scale = coat.object("clearcoatNormalTexture").number("scale", 1);
  const JsonNode sheen = extensions.object("KHR_materials_sheen");
  more.sheen_color = sheen.clamped_numbers<3>("sheenColorFactor", {0, 0, 0}, 0, 1);
  more.sheen_color_texture = read_texture_info(sheen, "sheenColorTexture", document);
  more.sheen_roughness = sheen.clamped("sheenRoughnessFactor", 0, 0, 1);
  more.sheen_roughness_texture = read_texture_info(sheen, "sheenRoughnessTexture", document);
}

void read_reflection(const JsonNode& extensions, const Document& document, MaterialExtensions& more) {
  const JsonNode anisotropy = extensions.object("KHR_materials_anisotropy");
  more.anisotropy = anisotropy.clamped("anisotropyStrength", 0, 0, 1);
  more.anisotropy_rotation = anisotropy.clamped("anisotropyRotation", 0, -1e4, 1e4);
  more.anisotropy_texture = read_texture_info(anisotropy, "anisotropyTexture", document);
  const JsonNode film = extensions.object("KHR_materials_iridescence");
  more.iridescence = film.clamped("iridescenceFactor", 0, 0, 1);
  more.iridescence_texture = read_texture_info(film, "iridescenceTexture", document);
  more.iridescence_ior = film.clamped("iridescenceIor", 1.3, 1, kMaxIor);
  more.film_minimum = film.clamped("iridescenceThicknessMinimum", 100, 0, kMaxFilmNanometres);
  more.film_maximum = film.clamped("iridescenceThicknessMaximum", 400, 0, kMaxFilmNanometres);
  more.film_texture = read_texture_info(film, "iridescenceThicknessTexture", document);
}

}  // namespace

std::optional<TextureInfo> read_texture_info(const JsonNode& parent, const char* name, const Document& document) {
  const JsonNode node = parent.object(name);
  if (!node.present()) return std::nullopt;
  TextureInfo info;
  info.texture = node.required_index("index", document.textures.size());
  info.texcoord = static_cast<uint32_t>(node.whole("texCoord", 0, kMaxTexcoordSets - 1));
  read_transform(node, info);
  return info;
}

void read_material_extensions(const JsonNode& node, const Document& document, Material& material) {
  const JsonNode extensions = node.object("extensions");
  const JsonNode emissive = extensions.object("KHR_materials_emissive_strength");
  material.emissive_strength = emissive.clamped("emissiveStrength", 1, 0, kMaxRadiance);
  const JsonNode ior = extensions.object("KHR_materials_ior");
  material.ior = ior.number("ior", 1.5);
  if (material.ior != 0 && material.ior < 1) {  // 0 stands for infinity in the extension
    ior.warn_at("ior", fmt::format("{} is below 1; 1 is used", material.ior));
    material.ior = 1;
  }
  const JsonNode specular = extensions.object("KHR_materials_specular");
  material.specular = specular.clamped("specularFactor", 1, 0, 1);
  material.specular_color = specular.clamped_numbers<3>("specularColorFactor", {1, 1, 1}, 0, kMaxRadiance);
  material.specular_texture = read_texture_info(specular, "specularTexture", document);
  material.specular_color_texture = read_texture_info(specular, "specularColorTexture", document);
  material.more.unlit = extensions.object("KHR_materials_unlit").present();
  read_transmission(extensions, document, material.more);
  read_coats(extensions, document, material.more);
  read_reflection(extensions, document, material.more);
}

}  // namespace shoal::gltf
