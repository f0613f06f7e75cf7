#include "engine/gltf_json_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "engine/gltf_extensions_json.h"

namespace shoal {
namespace {

constexpr size_t kBufferBytes = 1u << 20;

/// Objects, arrays and members as text. Commas come by themselves; the caller nests correctly.
class JsonText {
 public:
  explicit JsonText(AtomicFile& file) : file_(&file) { text_.reserve(kBufferBytes + 4096); }

  void open(char bracket) {
    separate();
    text_ += bracket;
    first_ = true;
  }
  void close(char bracket) {
    text_ += bracket;
    first_ = false;
    flush(kBufferBytes);
  }
  void key(const char* name) {
    separate();
    text_ += fmt::format("\"{}\":", name);
    first_ = true;  // its value follows without a comma
  }
  template <class T>
  void value(const T& number) {
    separate();
    text_ += fmt::format("{}", number);
  }
  void value(bool truth) { separate(), text_ += truth ? "true" : "false"; }
  void value(const char* text) { value(std::string(text)); }
  void value(const std::string& text) {
    separate();
    text_ += nlohmann::json(text).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  }
  /// JSON as it is.
  void text_member(const char* name, const std::string& json) {
    key(name);
    separate();
    text_ += json;
  }
  template <class T>
  void member(const char* name, const T& of) {
    key(name);
    value(of);
  }
  template <class Values>
  void array(const char* name, const Values& values) {
    key(name);
    open('[');
    for (const auto& one : values) value(one);
    close(']');
  }
  void new_line() { text_ += '\n'; }
  Status finish() {
    flush(0);
    return status_;
  }

 private:
  void separate() {
    if (!first_) text_ += ',';
    first_ = false;
  }
  void flush(size_t above_bytes) {
    if (text_.size() <= above_bytes) return;
    if (status_.ok()) status_ = file_->append(std::as_bytes(std::span(text_)));
    text_.clear();
  }

  AtomicFile* file_;
  std::string text_;
  Status status_;
  bool first_ = true;
};

/// An array of objects under `name`, left out when empty; one object a line.
template <class Items, class Write>
void objects(JsonText& json, const char* name, const Items& items, Write write) {
  if (items.empty()) return;
  json.new_line();
  json.key(name);
  json.open('[');
  for (size_t i = 0; i < items.size(); ++i) {
    json.new_line();
    json.open('{');
    write(items[i], i);
    json.close('}');
  }
  json.close(']');
}

const char* accessor_type(const gltf::Accessor& accessor) {
  constexpr const char* kNames[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
  SHOAL_CHECK(!accessor.matrix && accessor.components >= 1 && accessor.components <= 4);
  return kNames[accessor.components - 1];
}

void write_storage(JsonText& json, const gltf::Document& document, std::span<const PositionBounds> bounds) {
  objects(json, "buffers", document.buffers, [&](const gltf::Buffer& buffer, size_t) {
    json.member("byteLength", buffer.byte_length);
    json.member("uri", buffer.path);
  });
  objects(json, "bufferViews", document.views, [&](const gltf::BufferView& view, size_t) {
    json.member("buffer", view.buffer);
    json.member("byteOffset", view.byte_offset);
    json.member("byteLength", view.byte_length);
  });
  objects(json, "accessors", document.accessors, [&](const gltf::Accessor& accessor, size_t i) {
    SHOAL_CHECK(accessor.view.has_value() && !accessor.sparse.has_value());
    json.member("bufferView", *accessor.view);
    if (accessor.byte_offset != 0) json.member("byteOffset", accessor.byte_offset);
    json.member("count", accessor.count);
    json.member("type", accessor_type(accessor));
    json.member("componentType", static_cast<unsigned>(accessor.type));
    if (accessor.normalized) json.member("normalized", true);
    if (!bounds[i].present) return;
    // As doubles: the decimal then names the float exactly.
    json.array("min", std::vector<double>(bounds[i].lo, bounds[i].lo + 3));
    json.array("max", std::vector<double>(bounds[i].hi, bounds[i].hi + 3));
  });
}

void write_primitive(JsonText& json, const gltf::Primitive& primitive) {
  json.open('{');
  json.key("attributes");
  json.open('{');
  for (const auto& [name, accessor] : primitive.attributes) json.member(name.c_str(), accessor);
  json.close('}');
  if (primitive.indices) json.member("indices", *primitive.indices);
  if (primitive.material) json.member("material", *primitive.material);
  if (primitive.mode != gltf::PrimitiveMode::kTriangles) json.member("mode", static_cast<unsigned>(primitive.mode));
  json.close('}');
}

void write_texture_slot(JsonText& json, const char* name, const std::optional<gltf::TextureInfo>& info,
                        double normal_scale = 1) {
  if (!info) return;
  json.key(name);
  json.open('{');
  json.member("index", info->texture);
  if (info->texcoord != 0) json.member("texCoord", info->texcoord);
  if (normal_scale != 1) json.member("scale", normal_scale);
  if (info->transformed()) json.text_member("extensions", texture_transform_json(*info));
  json.close('}');
}

bool has_specular(const gltf::Material& material) {
  return material.specular != 1 || material.specular_color != std::array<double, 3>{1, 1, 1} ||
         material.specular_texture || material.specular_color_texture;
}

void write_material_extensions(JsonText& json, const gltf::Material& material) {
  const auto more = material_extensions_json(material);
  if (material.emissive_strength == 1 && material.ior == 1.5 && !has_specular(material) && more.empty()) return;
  json.key("extensions");
  json.open('{');
  if (material.emissive_strength != 1) {
    json.key("KHR_materials_emissive_strength");
    json.open('{');
    json.member("emissiveStrength", material.emissive_strength);
    json.close('}');
  }
  if (material.ior != 1.5) {
    json.key("KHR_materials_ior");
    json.open('{');
    json.member("ior", material.ior);
    json.close('}');
  }
  if (has_specular(material)) {
    json.key("KHR_materials_specular");
    json.open('{');
    json.member("specularFactor", material.specular);
    json.array("specularColorFactor", material.specular_color);
    write_texture_slot(json, "specularTexture", material.specular_texture);
    write_texture_slot(json, "specularColorTexture", material.specular_color_texture);
    json.close('}');
  }
  for (const auto& [name, extension] : more) json.text_member(name.c_str(), extension);
  json.close('}');
}

void write_material(JsonText& json, const gltf::Material& material) {
  if (!material.name.empty()) json.member("name", material.name);
  json.key("pbrMetallicRoughness");
  json.open('{');
  json.array("baseColorFactor", material.base_color);
  json.member("metallicFactor", material.metallic);
  json.member("roughnessFactor", material.roughness);
  write_texture_slot(json, "baseColorTexture", material.base_color_texture);
  write_texture_slot(json, "metallicRoughnessTexture", material.metallic_roughness_texture);
  json.close('}');
  write_texture_slot(json, "normalTexture", material.normal_texture, material.normal_scale);
  write_texture_slot(json, "emissiveTexture", material.emissive_texture);
  if (material.emissive != std::array<double, 3>{0, 0, 0}) json.array("emissiveFactor", material.emissive);
  if (material.alpha_mode == gltf::AlphaMode::kMask) {
    json.member("alphaMode", "MASK");
    json.member("alphaCutoff", material.alpha_cutoff);
  } else if (material.alpha_mode == gltf::AlphaMode::kBlend) {
    json.member("alphaMode", "BLEND");
  }
  if (material.double_sided) json.member("doubleSided", true);
  write_material_extensions(json, material);
}

void write_surfaces(JsonText& json, const gltf::Document& document) {
  objects(json, "materials", document.materials,
          [&](const gltf::Material& material, size_t) { write_material(json, material); });
  objects(json, "samplers", document.samplers, [&](const gltf::Sampler& sampler, size_t) {
    json.member("magFilter", sampler.nearest_magnification ? 9728 : 9729);
    json.member("wrapS", sampler.wrap_s);
    json.member("wrapT", sampler.wrap_t);
  });
  objects(json, "images", document.images,
          [&](const gltf::Image& image, size_t) { json.member("uri", image.path); });
  objects(json, "textures", document.textures, [&](const gltf::Texture& texture, size_t) {
    if (texture.sampler) json.member("sampler", *texture.sampler);
    if (texture.image) json.member("source", *texture.image);
  });
  objects(json, "meshes", document.meshes, [&](const gltf::Mesh& mesh, size_t) {
    if (!mesh.name.empty()) json.member("name", mesh.name);
    json.key("primitives");
    json.open('[');
    for (const gltf::Primitive& primitive : mesh.primitives) write_primitive(json, primitive);
    json.close(']');
  });
}

void write_camera(JsonText& json, const gltf::Camera& camera) {
  if (!camera.name.empty()) json.member("name", camera.name);
  json.member("type", camera.perspective ? "perspective" : "orthographic");
  json.key(camera.perspective ? "perspective" : "orthographic");
  json.open('{');
  if (camera.perspective) {
    json.member("yfov", camera.yfov);
    if (camera.aspect_ratio > 0) json.member("aspectRatio", camera.aspect_ratio);
  } else {
    json.member("xmag", camera.xmag);
    json.member("ymag", camera.ymag);
  }
  json.member("znear", 0.01);
  if (!camera.perspective) json.member("zfar", 1e6);
  json.close('}');
}

void write_light(JsonText& json, const gltf::Light& light) {
  constexpr const char* kTypes[] = {"directional", "point", "spot"};
  json.open('{');
  if (!light.name.empty()) json.member("name", light.name);
  json.member("type", kTypes[static_cast<size_t>(light.type)]);
  json.array("color", light.color);
  json.member("intensity", light.intensity);
  if (light.range > 0) json.member("range", light.range);
  if (light.type == gltf::LightType::kSpot) {
    json.key("spot");
    json.open('{');
    json.member("innerConeAngle", light.inner_cone);
    json.member("outerConeAngle", light.outer_cone);
    json.close('}');
  }
  json.close('}');
}

void write_node(JsonText& json, const gltf::Node& node) {
  static const gltf::Node kDefault;
  if (!node.name.empty()) json.member("name", node.name);
  if (!node.children.empty()) json.array("children", node.children);
  if (node.matrix != kDefault.matrix) json.array("matrix", node.matrix);
  if (node.mesh) json.member("mesh", *node.mesh);
  if (node.camera) json.member("camera", *node.camera);
  if (!node.light) return;
  json.key("extensions");
  json.open('{');
  json.key("KHR_lights_punctual");
  json.open('{');
  json.member("light", *node.light);
  json.close('}');
  json.close('}');
}

std::vector<std::string> extensions_of(const gltf::Document& document) {
  const auto any = [&](auto predicate) {
    return std::any_of(document.materials.begin(), document.materials.end(), predicate);
  };
  std::vector<std::string> used;
  std::set<std::string> more;
  for (const gltf::Material& m : document.materials) {
    for (const auto& [name, extension] : material_extensions_json(m)) {
      more.insert(name);
      if (extension.find("KHR_texture_transform") != std::string::npos) more.insert("KHR_texture_transform");
    }
    for (const auto* info : {&m.base_color_texture, &m.metallic_roughness_texture, &m.normal_texture,
                             &m.emissive_texture, &m.specular_texture, &m.specular_color_texture}) {
      if (*info && (*info)->transformed()) more.insert("KHR_texture_transform");
    }
  }
  if (!document.lights.empty()) used.push_back("KHR_lights_punctual");
  if (any([](const gltf::Material& m) { return m.emissive_strength != 1; })) {
    used.push_back("KHR_materials_emissive_strength");
  }
  if (any([](const gltf::Material& m) { return m.ior != 1.5; })) used.push_back("KHR_materials_ior");
  if (any(has_specular)) used.push_back("KHR_materials_specular");
  used.insert(used.end(), more.begin(), more.end());
  return used;
}

}  // namespace

Status write_gltf_json(const gltf::Document& document, std::span<const PositionBounds> bounds, AtomicFile& file) {
  SHOAL_CHECK(bounds.size() == document.accessors.size());
  JsonText json(file);
  json.open('{');
  json.key("asset");
  json.open('{');
  json.member("version", "2.0");
  json.member("generator", "shoal generate");
  json.close('}');
  if (const auto used = extensions_of(document); !used.empty()) json.array("extensionsUsed", used);
  json.member("scene", 0);
  json.key("scenes");
  json.open('[');
  json.open('{');
  json.array("nodes", document.roots);
  json.close('}');
  json.close(']');
  if (!document.lights.empty()) {
    json.key("extensions");
    json.open('{');
    json.key("KHR_lights_punctual");
    json.open('{');
    json.key("lights");
    json.open('[');
    for (const gltf::Light& light : document.lights) write_light(json, light);
    json.close(']');
    json.close('}');
    json.close('}');
  }
  objects(json, "cameras", document.cameras,
          [&](const gltf::Camera& camera, size_t) { write_camera(json, camera); });
  objects(json, "nodes", document.nodes, [&](const gltf::Node& node, size_t) { write_node(json, node); });
  write_surfaces(json, document);
  write_storage(json, document, bounds);
  json.close('}');
  json.new_line();
  return json.finish();
}

}  // namespace shoal
