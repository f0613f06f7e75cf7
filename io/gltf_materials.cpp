// Materials, textures, samplers and images.
#include <fmt/format.h>

#include "io/gltf_sections.h"
#include "io/uri.h"

namespace shoal::gltf {

namespace {

AlphaMode read_alpha_mode(const JsonNode& node) {
  const std::string mode = node.text("alphaMode", "OPAQUE");
  if (mode == "MASK") return AlphaMode::kMask;
  if (mode == "BLEND") return AlphaMode::kBlend;
  if (mode != "OPAQUE") node.fail_at("alphaMode", "OPAQUE, MASK or BLEND", printable(mode));
  return AlphaMode::kOpaque;
}

void read_material(const JsonNode& node, const Document& document, Material& material) {
  material.name = node.text("name");
  const JsonNode pbr = node.object("pbrMetallicRoughness");
  material.base_color = pbr.clamped_numbers<4>("baseColorFactor", {1, 1, 1, 1}, 0, 1);
  material.metallic = pbr.clamped("metallicFactor", 1, 0, 1);
  material.roughness = pbr.clamped("roughnessFactor", 1, 0, 1);
  material.base_color_texture = read_texture_info(pbr, "baseColorTexture", document);
  material.metallic_roughness_texture = read_texture_info(pbr, "metallicRoughnessTexture", document);
  // Above 1 is against the letter of glTF, but older exporters wrote lights so and meant it.
  material.emissive = node.clamped_numbers<3>("emissiveFactor", {0, 0, 0}, 0, kMaxRadiance);
  material.emissive_texture = read_texture_info(node, "emissiveTexture", document);
  material.normal_texture = read_texture_info(node, "normalTexture", document);
  material.normal_scale = node.object("normalTexture").number("scale", 1);
  material.alpha_mode = read_alpha_mode(node);
  material.alpha_cutoff = node.number("alphaCutoff", 0.5);
  material.double_sided = node.boolean("doubleSided", false);
  read_material_extensions(node, document, material);
}

uint32_t read_wrap(const JsonNode& node, const char* name) {
  const uint64_t wrap = node.whole(name, 10497);
  if (wrap != 33071 && wrap != 33648 && wrap != 10497) {
    node.fail_at(name, "33071, 33648 or 10497", fmt::format("{}", wrap));
  }
  return static_cast<uint32_t>(wrap);
}

void read_image(const JsonNode& node, uint64_t i, const Document& document, Image& image) {
  image.name = fmt::format("image {}", i);
  const std::string uri = node.text("uri");
  if (is_data_uri(uri)) {
    auto bytes = decode_data_uri(uri);
    if (!bytes.ok()) return node.fail_at("uri", bytes.error().message, printable(uri));
    image.embedded = std::move(bytes).value();
  } else if (!uri.empty()) {
    auto path = resolve_uri(document.folder, uri);
    if (!path.ok()) return node.fail_at("uri", path.error().message, printable(uri));
    image.path = std::move(path).value();
    image.name = printable(uri);
  } else {
    image.view = node.index("bufferView", document.views.size());
    if (!image.view) node.fail("a uri or a bufferView", "neither");
  }
}

}  // namespace

void read_textures(const JsonNode& root, const Limits& limits, Document& document) {
  const JsonNode samplers = root.array("samplers", limits.objects_count);
  document.samplers.resize(samplers.size());
  for (uint64_t i = 0; i < samplers.size() && !root.failed(); ++i) {
    const JsonNode node = samplers.object_at(i);
    document.samplers[i].nearest_magnification = node.whole("magFilter", 9729) == 9728;
    document.samplers[i].wrap_s = read_wrap(node, "wrapS");
    document.samplers[i].wrap_t = read_wrap(node, "wrapT");
  }
  const JsonNode images = root.array("images", limits.objects_count);
  document.images.resize(images.size());
  for (uint64_t i = 0; i < images.size() && !root.failed(); ++i) {
    read_image(images.object_at(i), i, document, document.images[i]);
  }
  const JsonNode textures = root.array("textures", limits.objects_count);
  document.textures.resize(textures.size());
  for (uint64_t i = 0; i < textures.size() && !root.failed(); ++i) {
    const JsonNode node = textures.object_at(i);
    document.textures[i].sampler = node.index("sampler", document.samplers.size());
    document.textures[i].image = node.index("source", document.images.size());
    const JsonNode extensions = node.object("extensions");
    const auto webp = extensions.object("EXT_texture_webp").index("source", document.images.size());
    if (webp) document.textures[i].image = webp;
    document.textures[i].basisu = extensions.object("KHR_texture_basisu").present();
  }
}

void read_materials(const JsonNode& root, const Limits& limits, Document& document) {
  const JsonNode array = root.array("materials", limits.objects_count);
  document.materials.resize(array.size());
  for (uint64_t i = 0; i < array.size() && !root.failed(); ++i) {
    read_material(array.object_at(i), document, document.materials[i]);
  }
}

}  // namespace shoal::gltf
