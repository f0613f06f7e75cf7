// Which glTF extensions are read, and what to say about the others.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "io/gltf_sections.h"

namespace shoal::gltf {

namespace {

constexpr std::array<std::string_view, 21> kRead = {
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_basisu",  // textures that have nothing else are refused where they are read
    "KHR_texture_transform",
};

/// Extensions that only describe: leaving them out changes no picture.
constexpr std::array<std::string_view, 2> kWithoutEffect = {"KHR_xmp", "KHR_xmp_json_ld"};

struct Advice {
  std::string_view name, text;
};
constexpr std::array<Advice, 1> kAdvice = {{
    {"EXT_texture_avif", "convert its textures first, for example with `gltf-transform png IN OUT`"},
}};

std::vector<std::string> read_names(const JsonNode& root, const char* key, const Limits& limits) {
  std::vector<std::string> names;
  const JsonNode array = root.array(key, limits.objects_count);
  for (uint64_t i = 0; i < array.size() && !root.failed(); ++i) names.push_back(array[i].as_text());
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

bool contains(std::span<const std::string_view> names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

bool extension_supported(const std::string& name) { return contains(kRead, name); }

void read_extensions(const JsonNode& root, const Limits& limits, Document& document) {
  document.extensions_used = read_names(root, "extensionsUsed", limits);
  document.extensions_required = read_names(root, "extensionsRequired", limits);
  for (const std::string& name : document.extensions_used) {
    if (extension_supported(name) || contains(kWithoutEffect, name)) continue;
    if (document.warnings.size() >= JsonText::kMaxWarnings) break;
    const bool known = name.starts_with("KHR_") || name.starts_with("EXT_");
    document.warnings.push_back(known ? fmt::format("{} is not simulated yet", printable(name))
                                      : fmt::format("{} is not known and is ignored", printable(name)));
  }
}

Status check_required_extensions(const Document& document) {
  for (const std::string& name : document.extensions_required) {
    if (extension_supported(name) || contains(kWithoutEffect, name)) continue;
    std::string_view advice = "export the scene without it";
    for (const Advice& known : kAdvice) {
      if (known.name == name) advice = known.text;
    }
    return Error{ErrorCode::kUnsupported, fmt::format("{}: extensionsRequired: {} is not supported; {}",
                                                      document.path, printable(name), advice)};
  }
  return {};
}

Status check_texture_sources(const Document& document) {
  for (size_t i = 0; i < document.textures.size(); ++i) {
    if (!document.textures[i].basisu || document.textures[i].image) continue;
    return Error{ErrorCode::kUnsupported,
                 fmt::format("{}: textures[{}]: KHR_texture_basisu is not supported, and the texture has no other source; "
                             "convert its textures first, for example with `gltf-transform ktxdecompress IN OUT`",
                             document.path, i)};
  }
  return {};
}

}  // namespace shoal::gltf
