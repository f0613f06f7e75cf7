#include "engine/convert_materials.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <tuple>

#include "engine/flatten_nodes.h"

namespace shoal {

namespace {

constexpr double kFloatMax = std::numeric_limits<float>::max();

std::string material_name(const gltf::Document& document, uint32_t material) {
  const std::string& name = document.materials[material].name;
  return fmt::format("materials[{}]{}", material, name.empty() ? "" : " \"" + name + "\"");
}

WrapMode wrap_mode(uint32_t gl_enum) {
  switch (gl_enum) {
    case 33071:
      return WrapMode::kClampToEdge;
    case 33648:
      return WrapMode::kMirroredRepeat;
    default:
      return WrapMode::kRepeat;
  }
}

Material convert_factors(const gltf::Material& in) {
  Material out = {};
  for (int i = 0; i < 4; ++i) out.base_color[i] = clamped_float(in.base_color[i], 0, 1);
  for (int i = 0; i < 3; ++i) {
    out.emissive[i] = clamped_float(in.emissive[i] * in.emissive_strength, 0, kFloatMax);
    out.specular_color[i] = clamped_float(in.specular_color[i], 0, kFloatMax);
  }
  out.metallic = clamped_float(in.metallic, 0, 1);
  out.roughness = clamped_float(in.roughness, 0, 1);
  out.specular = clamped_float(in.specular, 0, 1);
  const double f = (in.ior - 1) / (in.ior + 1);  // Fresnel at normal incidence; ior 0 means full reflection
  out.dielectric_f0 = clamped_float(f * f, 0, 1);
  out.normal_scale = clamped_float(in.normal_scale, -kFloatMax, kFloatMax);
  out.alpha_cutoff = clamped_float(in.alpha_cutoff, 0, kFloatMax);
  switch (in.alpha_mode) {
    case gltf::AlphaMode::kOpaque:
      out.coverage = CoverageMode::kOpaque;
      break;
    case gltf::AlphaMode::kMask:
      out.coverage = CoverageMode::kMask;
      break;
    case gltf::AlphaMode::kBlend:
      out.coverage = CoverageMode::kBlend;
      break;
  }
  return out;
}

/// Fills the texture slots of materials; a texture wanted in the same way twice is one.
class SlotPlanner {
 public:
  SlotPlanner(const gltf::Document& document, MaterialPlan& plan) : document_(document), plan_(plan) {}

  Status plan(uint32_t material, Material& out) {
    material_ = material;
    const gltf::Material& in = document_.materials[material_];
    // A texture that a zero factor silences is not stored.
    const bool specular = out.specular > 0, reflects = specular || out.metallic > 0;
    const bool emits = out.emissive[0] > 0 || out.emissive[1] > 0 || out.emissive[2] > 0;
    const bool glossy = out.roughness > 0 || out.metallic > 0;
    SHOAL_RETURN_IF_ERROR(slot(in.base_color_texture, true, true, out.base_color_texture));
    SHOAL_RETURN_IF_ERROR(
        slot(in.metallic_roughness_texture, reflects && glossy, false, out.metallic_roughness_texture));
    SHOAL_RETURN_IF_ERROR(slot(in.normal_texture, out.normal_scale != 0, false, out.normal_texture));
    SHOAL_RETURN_IF_ERROR(slot(in.emissive_texture, emits, true, out.emissive_texture));
    SHOAL_RETURN_IF_ERROR(slot(in.specular_texture, specular, false, out.specular_texture));
    SHOAL_RETURN_IF_ERROR(slot(in.specular_color_texture, specular, true, out.specular_color_texture));
    if (out.coverage != CoverageMode::kOpaque && out.base_color_texture.texture != kNoIndex) {
      plan_.textures[out.base_color_texture.texture].needs_alpha = true;
    }
    return {};
  }

 private:
  Status slot(const std::optional<gltf::TextureInfo>& info, bool wanted, bool srgb, TextureSlot& out) {
    if (!info || !wanted) return {};
    const gltf::Texture& texture = document_.textures[info->texture];
    if (!texture.image) {
      plan_.warnings.push_back(
          fmt::format("{}: textures[{}] has no image that can be read; its factor is used alone",
                      material_name(document_, material_), info->texture));
      return {};
    }
    SHOAL_ASSIGN_OR_RETURN(out.uv_set, uv_set(info->texcoord));
    out.texture = request(texture, srgb);
    return {};
  }

  Result<uint32_t> uv_set(uint32_t texcoord) {
    MaterialUvSets& sets = plan_.uv_sets[material_];
    for (uint32_t i = 0; i < sets.count; ++i) {
      if (sets.texcoord[i] == texcoord) return i;
    }
    if (sets.count == kMaxUvSets) {
      return Error{ErrorCode::kInput, fmt::format("{}: {}: expected at most {} texture coordinate sets, found more",
                                                  document_.path, material_name(document_, material_), kMaxUvSets)};
    }
    sets.texcoord[sets.count] = texcoord;
    return sets.count++;
  }

  uint32_t request(const gltf::Texture& texture, bool srgb) {
    const gltf::Sampler sampler = texture.sampler ? document_.samplers[*texture.sampler] : gltf::Sampler{};
    TextureRequest wanted;
    wanted.image = *texture.image;
    wanted.srgb = srgb;
    wanted.wrap_u = wrap_mode(sampler.wrap_s), wanted.wrap_v = wrap_mode(sampler.wrap_t);
    wanted.nearest = sampler.nearest_magnification;
    const Key key{wanted.image, srgb, wanted.wrap_u, wanted.wrap_v, wanted.nearest};
    const auto [found, added] = known_.try_emplace(key, static_cast<uint32_t>(plan_.textures.size()));
    if (!added) return found->second;
    wanted.user = material_name(document_, material_);
    plan_.textures.push_back(std::move(wanted));
    return found->second;
  }

  using Key = std::tuple<uint32_t, bool, WrapMode, WrapMode, bool>;
  const gltf::Document& document_;
  MaterialPlan& plan_;
  uint32_t material_ = 0;
  std::map<Key, uint32_t> known_;
};

/// Alpha that is 1 everywhere is no alpha: exporters often write BLEND for opaque surfaces.
bool covers_all(const Material& material, const std::vector<TextureFacts>& textures, bool vertex_alpha) {
  if (material.coverage == CoverageMode::kOpaque) return true;
  if (material.coverage == CoverageMode::kMask && material.alpha_cutoff <= 0) return true;
  if (material.coverage == CoverageMode::kMask && material.alpha_cutoff > 1) return false;
  const uint32_t texture = material.base_color_texture.texture;
  return material.base_color[3] >= 1 && !vertex_alpha && (texture == kNoIndex || textures[texture].opaque);
}

void set_emission(Material& material, const std::vector<TextureFacts>& textures) {
  const uint32_t texture = material.emissive_texture.texture;
  constexpr double kLuminance[3] = {0.2126, 0.7152, 0.0722};  // ITU-R BT.709, linear light
  double weight = 0;
  for (int i = 0; i < 3; ++i) {
    weight += kLuminance[i] * material.emissive[i] * (texture == kNoIndex ? 1.0 : textures[texture].mean[i]);
  }
  material.emission_weight = clamped_float(weight, 0, kFloatMax);
  if (material.emission_weight > 0) material.flags |= kMaterialEmits;
}

}  // namespace

Result<MaterialPlan> plan_materials(const gltf::Document& document, const std::vector<MaterialUse>& uses) {
  SHOAL_CHECK(uses.size() == document.materials.size() + 1);
  MaterialPlan plan;
  plan.uv_sets.resize(document.materials.size());
  SlotPlanner slots(document, plan);
  for (uint32_t m = 0; m < document.materials.size(); ++m) {
    Material material = convert_factors(document.materials[m]);
    if (uses[m].used) SHOAL_RETURN_IF_ERROR(slots.plan(m, material));
    plan.materials.push_back(material);
  }
  if (uses.back().used) {
    plan.default_material = static_cast<uint32_t>(plan.materials.size());
    plan.materials.push_back(convert_factors(gltf::Material{}));
    plan.uv_sets.emplace_back();
  }
  return plan;
}

void finish_materials(MaterialPlan& plan, const std::vector<TextureFacts>& textures,
                      const std::vector<MaterialUse>& uses) {
  for (size_t m = 0; m < plan.materials.size(); ++m) {
    Material& material = plan.materials[m];
    if (covers_all(material, textures, uses[m].vertex_alpha)) material.coverage = CoverageMode::kOpaque;
    set_emission(material, textures);
  }
}

}  // namespace shoal
