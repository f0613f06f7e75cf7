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

Primitive read_primitive(const JsonNode& node, const Limits& limits, const Document& document) {
  Primitive primitive;
  read_attributes(node, document, primitive);
  primitive.indices = node.index("indices", document.accessors.size());
  check_indices(node, document, primitive);
  primitive.material = node.index("material", document.materials.size());
  read_variant_materials(node, limits, document, primitive);
  constexpr auto kLast = static_cast<uint64_t>(PrimitiveMode::kTriangleFan);
  primitive.mode =
      static_cast<PrimitiveMode>(node.whole("mode", static_cast<uint64_t>(PrimitiveMode::kTriangles), kLast));
  return primitive;
}

}  // namespace

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
  }
}

}  // namespace shoal::gltf
