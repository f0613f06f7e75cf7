#include "engine/gltf_extensions_json.h"

#include <nlohmann/json.hpp>

namespace shoal {
namespace {

using Json = nlohmann::ordered_json;

Json transform_json(const gltf::TextureInfo& info) {
  return {{"KHR_texture_transform", {{"offset", info.offset}, {"rotation", info.rotation}, {"scale", info.scale}}}};
}

/// Collects the members of one extension that differ from their defaults.
class Members {
 public:
  template <class T>
  void value(const char* name, const T& value, const T& standard) {
    if (value != standard) json_[name] = value;
  }
  void texture(const char* name, const std::optional<gltf::TextureInfo>& info, double scale = 1) {
    if (!info) return;
    Json& slot = json_[name] = {{"index", info->texture}};
    if (info->texcoord != 0) slot["texCoord"] = info->texcoord;
    if (scale != 1) slot["scale"] = scale;
    if (info->transformed()) slot["extensions"] = transform_json(*info);
  }
  void put(const char* extension, std::map<std::string, std::string>& out) const {
    if (!json_.empty()) out[extension] = json_.dump();
  }

 private:
  Json json_ = Json::object();
};

using Colour = std::array<double, 3>;

void put_transmission(const gltf::MaterialExtensions& x, std::map<std::string, std::string>& out) {
  Members transmission, volume, dispersion, diffuse;
  transmission.value("transmissionFactor", x.transmission, 0.0);
  transmission.texture("transmissionTexture", x.transmission_texture);
  volume.value("thicknessFactor", x.has_volume ? 1.0 : 0.0, 0.0);  // how thick is for rasterisers
  volume.value("attenuationDistance", x.attenuation_distance, 0.0);
  volume.value("attenuationColor", x.attenuation_color, Colour{1, 1, 1});
  dispersion.value("dispersion", x.dispersion, 0.0);
  diffuse.value("diffuseTransmissionFactor", x.diffuse_transmission, 0.0);
  diffuse.value("diffuseTransmissionColorFactor", x.diffuse_transmission_color, Colour{1, 1, 1});
  diffuse.texture("diffuseTransmissionTexture", x.diffuse_transmission_texture);
  diffuse.texture("diffuseTransmissionColorTexture", x.diffuse_transmission_color_texture);
  transmission.put("KHR_materials_transmission", out);
  volume.put("KHR_materials_volume", out);
  dispersion.put("KHR_materials_dispersion", out);
  diffuse.put("KHR_materials_diffuse_transmission", out);
}

void put_coats(const gltf::MaterialExtensions& x, std::map<std::string, std::string>& out) {
  Members coat, sheen;
  coat.value("clearcoatFactor", x.clearcoat, 0.0);
  coat.value("clearcoatRoughnessFactor", x.clearcoat_roughness, 0.0);
  coat.texture("clearcoatTexture", x.clearcoat_texture);
  coat.texture("clearcoatRoughnessTexture", x.clearcoat_roughness_texture);
  coat.texture("clearcoatNormalTexture", x.clearcoat_normal_texture, x.clearcoat_normal_scale);
  sheen.value("sheenColorFactor", x.sheen_color, Colour{0, 0, 0});
  sheen.value("sheenRoughnessFactor", x.sheen_roughness, 0.0);
  sheen.texture("sheenColorTexture", x.sheen_color_texture);
  sheen.texture("sheenRoughnessTexture", x.sheen_roughness_texture);
  coat.put("KHR_materials_clearcoat", out);
  sheen.put("KHR_materials_sheen", out);
}

void put_reflection(const gltf::MaterialExtensions& x, std::map<std::string, std::string>& out) {
  Members anisotropy, film;
  anisotropy.value("anisotropyStrength", x.anisotropy, 0.0);
  anisotropy.value("anisotropyRotation", x.anisotropy_rotation, 0.0);
  anisotropy.texture("anisotropyTexture", x.anisotropy_texture);
  film.value("iridescenceFactor", x.iridescence, 0.0);
  film.value("iridescenceIor", x.iridescence_ior, 1.3);
  film.value("iridescenceThicknessMinimum", x.film_minimum, 100.0);
  film.value("iridescenceThicknessMaximum", x.film_maximum, 400.0);
  film.texture("iridescenceTexture", x.iridescence_texture);
  film.texture("iridescenceThicknessTexture", x.film_texture);
  anisotropy.put("KHR_materials_anisotropy", out);
  film.put("KHR_materials_iridescence", out);
}

}  // namespace

std::string texture_transform_json(const gltf::TextureInfo& info) {
  return info.transformed() ? transform_json(info).dump() : std::string();
}

std::map<std::string, std::string> material_extensions_json(const gltf::Material& material) {
  std::map<std::string, std::string> out;
  if (material.more.unlit) out["KHR_materials_unlit"] = "{}";
  put_transmission(material.more, out);
  put_coats(material.more, out);
  put_reflection(material.more, out);
  return out;
}

}  // namespace shoal
