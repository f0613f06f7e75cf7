// KHR_materials_variants: named sets of materials for the primitives of a scene.
#include <fmt/format.h>

#include <algorithm>

#include "io/gltf_sections.h"

namespace shoal::gltf {
namespace {

/// In a message: names are listed until there are so many or their list is so long.
constexpr size_t kMaxNamedVariants = 20, kMaxListBytes = 160;

}  // namespace

void read_variants(const JsonNode& root, const Limits& limits, Document& document) {
  const JsonNode extension = root.object("extensions").object("KHR_materials_variants");
  const JsonNode array = extension.array("variants", limits.objects_count);
  for (uint64_t i = 0; i < array.size() && !root.failed(); ++i) {
    document.variants.push_back(array.object_at(i).text("name"));
  }
}

void read_variant_materials(const JsonNode& node, const Limits& limits, const Document& document,
                            Primitive& primitive) {
  const JsonNode extension = node.object("extensions").object("KHR_materials_variants");
  if (!extension.present()) return;
  const JsonNode mappings = extension.array("mappings", limits.objects_count);
  for (uint64_t i = 0; i < mappings.size() && !node.failed(); ++i) {
    const JsonNode mapping = mappings.object_at(i);
    VariantMaterial found;
    found.material = mapping.required_index("material", document.materials.size());
    const JsonNode variants = mapping.array("variants", limits.objects_count);
    for (uint64_t k = 0; k < variants.size() && !node.failed(); ++k) {
      found.variants.push_back(static_cast<uint32_t>(variants[k].as_index(document.variants.size())));
    }
    primitive.variant_materials.push_back(std::move(found));
  }
}

Status select_variant(Document& document, const std::string& name) {
  const auto at = std::find(document.variants.begin(), document.variants.end(), name);
  if (at == document.variants.end()) {
    std::string known;
    size_t shown = 0;
    for (; shown < std::min(document.variants.size(), kMaxNamedVariants) && known.size() < kMaxListBytes; ++shown) {
      known += (shown == 0 ? "" : ", ") + printable(document.variants[shown]);
    }
    if (shown < document.variants.size()) known += fmt::format(" and {} more", document.variants.size() - shown);
    return Error{ErrorCode::kUsage,
                 fmt::format("{}: no variant '{}': {}", document.path, printable(name),
                             known.empty() ? "the scene has none" : "expected one of " + known)};
  }
  const auto variant = static_cast<uint32_t>(at - document.variants.begin());
  for (Mesh& mesh : document.meshes) {
    for (Primitive& primitive : mesh.primitives) {
      for (const VariantMaterial& choice : primitive.variant_materials) {
        const auto& in = choice.variants;
        if (std::find(in.begin(), in.end(), variant) == in.end()) continue;
        primitive.material = choice.material;
        break;
      }
    }
  }
  return {};
}

void forget_variants(Document& document) {
  for (Mesh& mesh : document.meshes) {
    for (Primitive& primitive : mesh.primitives) std::vector<VariantMaterial>().swap(primitive.variant_materials);
  }
}

}  // namespace shoal::gltf
