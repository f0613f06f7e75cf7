// Meshes: each primitive's attributes and indices must have the shape that their names promise.
#include <fmt/format.h>

#include "io/gltf_sections.h"

namespace shoal::gltf {

namespace {

struct Widths {
  uint32_t least, most;
};

/// How many components an attribute of this name has; anything for names of applications (_NAME) and skins.
Widths expected_widths(std::string_view name) {
  if (name == "POSITION" || name == "NORMAL") return {3, 3};
  if (name == "TANGENT") return {4, 4};
  if (name.starts_with("TEXCOORD_")) return {2, 2};
  if (name.starts_with("COLOR_")) return {3, 4};
  return {1, 16};
}

void read_attributes(const JsonNode& node, const Document& document, Primitive& primitive) {
  const JsonNode attributes = node.object("attributes");
  attributes.each_member([&](const char* name, const JsonNode& value) {
    const auto index = static_cast<uint32_t>(value.as_index(document.accessors.size()));
    if (node.failed()) return;
    const Accessor& accessor = document.accessors[index];
    const Widths widths = expected_widths(name);
    if (accessor.components < widths.least || accessor.components > widths.most) {
      value.fail(fmt::format("an accessor of {} components", widths.most),
                 fmt::format("accessors[{}] of {}", index, accessor.components));
    }
    primitive.attributes[name] = index;
  });
  const auto position = primitive.attributes.find("POSITION");
  if (node.failed() || position == primitive.attributes.end()) return;
  const uint64_t count = document.accessors[position->second].count;
  for (const auto& [name, index] : primitive.attributes) {
    if (document.accessors[index].count >= count) continue;
    attributes.fail_at(name.c_str(), fmt::format("{} elements, as POSITION has", count),
                       fmt::format("{}", document.accessors[index].count));
  }
}

void check_indices(const JsonNode& node, const Document& document, const Primitive& primitive) {
  if (!primitive.indices || node.failed()) return;
  const Accessor& accessor = document.accessors[*primitive.indices];
  const bool is_unsigned = accessor.type == ComponentType::kUnsignedByte ||
                           accessor.type == ComponentType::kUnsignedShort ||
                           accessor.type == ComponentType::kUnsignedInt;
  if (accessor.components == 1 && is_unsigned) return;
  node.fail_at("indices", "an accessor of unsigned integer scalars",
               fmt::format("accessors[{}] of {} components of type {}", *primitive.indices, accessor.components,
                           static_cast<int>(accessor.type)));
}

std::optional<uint32_t> read_target_attribute(const JsonNode& node, const char* name, const Document& document,
                                              uint64_t vertex_count) {
  const auto index = node.index(name, document.accessors.size());
  if (!index || node.failed()) return index;
  const Accessor& accessor = document.accessors[*index];
  if (accessor.components != 3 || accessor.matrix || accessor.count < vertex_count) {
    node.fail_at(name, fmt::format("{} elements of 3 components, as POSITION has", vertex_count),
                 fmt::format("accessors[{}] of {} elements of {} components", *index, accessor.count,
                             accessor.components));
  }
  return index;
}

void read_targets(const JsonNode& node, const Document& document, Primitive& primitive) {
  const JsonNode targets = node.array("targets", kMaxTargets);
  const auto position = primitive.attributes.find("POSITION");
  const uint64_t vertices =
      position == primitive.attributes.end() ? 0 : document.accessors[position->second].count;
  for (uint64_t t = 0; t < targets.size() && !node.failed(); ++t) {
    const JsonNode target = targets.object_at(t);
    primitive.targets.push_back({read_target_attribute(target, "POSITION", document, vertices),
                                 read_target_attribute(target, "NORMAL", document, vertices),
                                 read_target_attribute(target, "TANGENT", document, vertices)});
  }
}

/// All primitives of a mesh have as many targets, and so many weights where there are any (glTF 2.0, section 3.7.2.2).
void check_targets(const JsonNode& node, const Mesh& mesh) {
  if (mesh.primitives.empty() || node.failed()) return;
  const size_t count = mesh.primitives.front().targets.size();
  for (const Primitive& primitive : mesh.primitives) {
    if (primitive.targets.size() == count) continue;
    return node.fail_at("primitives", fmt::format("{} morph targets each", count),
                        fmt::format("{}", primitive.targets.size()));
  }
  if (mesh.weights.empty() || mesh.weights.size() == count) return;
  node.fail_at("weights", fmt::format("{}, one a morph target", count), fmt::format("{}", mesh.weights.size()));
}

/// Where the accessors have bytes of their own as well, those are read: they need not be held whole.
bool needs_draco(const Document& document, const Primitive& primitive, const DracoPrimitive& draco) {
  if (primitive.indices && !document.accessors[*primitive.indices].view) return true;
  for (const auto& [name, id] : draco.attributes) {
    const Accessor& accessor = document.accessors[primitive.attributes.at(name)];
    if (!accessor.view && !accessor.sparse) return true;
  }
  return false;
}

void read_draco(const JsonNode& primitive_node, Document& document, Primitive& primitive) {
  const JsonNode node = primitive_node.object("extensions").object("KHR_draco_mesh_compression");
  if (!node.present() || primitive_node.failed()) return;
  DracoPrimitive draco;
  draco.view = node.required_index("bufferView", document.views.size());
  const JsonNode attributes = node.object("attributes");
  attributes.each_member([&](const char* name, const JsonNode&) {
    draco.attributes[name] = static_cast<uint32_t>(attributes.required_whole(name, 0xffffffffu));
    if (primitive.attributes.contains(name)) return;
    attributes.fail_at(name, "an attribute that the primitive has as well", "none");
  });
  if (node.failed() || !needs_draco(document, primitive, draco)) return;
  if (document.views[draco.view].meshopt) node.fail_at("bufferView", "a view that is not compressed again", "one that is");
  if (!primitive.indices) primitive_node.fail_at("indices", "an accessor, as every Draco mesh has", "nothing");
  if (!draco.attributes.contains("POSITION")) node.fail_at("attributes", "POSITION", "none");
  if (primitive.mode != PrimitiveMode::kTriangles) {
    primitive_node.fail_at("mode", "4 (triangles) of a Draco mesh", fmt::format("{}", static_cast<int>(primitive.mode)));
  }
  primitive.draco = static_cast<uint32_t>(document.draco_primitives.size());
  document.draco_primitives.push_back(std::move(draco));
}

Primitive read_primitive(const JsonNode& node, const Limits& limits, Document& document) {
  Primitive primitive;
  read_attributes(node, document, primitive);
  primitive.indices = node.index("indices", document.accessors.size());
  check_indices(node, document, primitive);
  primitive.material = node.index("material", document.materials.size());
  read_variant_materials(node, limits, document, primitive);
  constexpr auto kLast = static_cast<uint64_t>(PrimitiveMode::kTriangleFan);
  primitive.mode =
      static_cast<PrimitiveMode>(node.whole("mode", static_cast<uint64_t>(PrimitiveMode::kTriangles), kLast));
  read_targets(node, document, primitive);
  read_draco(node, document, primitive);
  return primitive;
}

}  // namespace

std::vector<double> read_weights(const JsonNode& node) {
  std::vector<double> weights;
  const JsonNode array = node.array("weights", kMaxTargets);
  for (uint64_t i = 0; i < array.size() && !node.failed(); ++i) weights.push_back(array[i].as_number());
  return weights;
}

void read_meshes(const JsonNode& root, const Limits& limits, Document& document) {
  const JsonNode array = root.array("meshes", limits.objects_count);
  document.meshes.resize(array.size());
  for (uint64_t i = 0; i < array.size() && !root.failed(); ++i) {
    const JsonNode node = array.object_at(i);
    Mesh& mesh = document.meshes[i];
    mesh.name = node.text("name");
    const JsonNode primitives = node.array("primitives", limits.objects_count);
    mesh.primitives.reserve(primitives.size());
    for (uint64_t k = 0; k < primitives.size() && !root.failed(); ++k) {
      mesh.primitives.push_back(read_primitive(primitives.object_at(k), limits, document));
    }
    mesh.weights = read_weights(node);
    check_targets(node, mesh);
  }
}

}  // namespace shoal::gltf
