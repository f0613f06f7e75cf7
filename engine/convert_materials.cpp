#include "engine/convert_materials.h"

#include <limits>

#include "engine/convert_layers.h"
#include "engine/flatten_nodes.h"
#include "engine/plan_slots.h"

namespace shoal {

namespace {

constexpr double kFloatMax = std::numeric_limits<float>::max();

Material convert_factors(const gltf::Material& in) {
  Material out = {};
  out.layers = kNoIndex;
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
  if (in.more.unlit) {  // the extension: everything but the base colour is ignored
    out.emissive[0] = out.emissive[1] = out.emissive[2] = 0;
    out.effects = kEffectUnlit;
  }
  return out;
}

/// Fills the texture slots that every material has. A texture that a zero factor silences is not stored.
Status plan_textures(SlotPlanner& slots, const gltf::Material& in, Material& out) {
  const bool specular = out.specular > 0, reflects = specular || out.metallic > 0 || in.more.transmission > 0;
  const bool emits = out.emissive[0] > 0 || out.emissive[1] > 0 || out.emissive[2] > 0;
  const bool glossy = out.roughness > 0 || out.metallic > 0;
  SHOAL_RETURN_IF_ERROR(slots.slot(in.base_color_texture, true, true, out.base_color_texture));
  if (in.more.unlit) return {};
  SHOAL_RETURN_IF_ERROR(
      slots.slot(in.metallic_roughness_texture, reflects && glossy, false, out.metallic_roughness_texture));
  SHOAL_RETURN_IF_ERROR(slots.slot(in.normal_texture, out.normal_scale != 0, false, out.normal_texture));
  SHOAL_RETURN_IF_ERROR(slots.slot(in.emissive_texture, emits, true, out.emissive_texture));
  SHOAL_RETURN_IF_ERROR(slots.slot(in.specular_texture, specular, false, out.specular_texture));
  return slots.slot(in.specular_color_texture, specular, true, out.specular_color_texture);
}

void note_effects(Material& out, const MaterialPlan& plan) {
  if (out.normal_texture.texture != kNoIndex) out.effects |= kEffectNormalMap;
  bool transformed = false;
  for (const TextureSlot* s : texture_slots(out)) transformed = transformed || s->transform != 0;
  if (out.layers != kNoIndex) {
    const MaterialLayers& layers = plan.layers[out.layers];
    transformed = transformed || has_transform(layers);
    if (layers.clearcoat_normal_texture.texture != kNoIndex) out.effects |= kEffectNormalMap;
  }
  if (transformed) out.effects |= kEffectTextureTransform;
}

Status plan_material(SlotPlanner& slots, const gltf::Material& in, MaterialPlan& plan, Material& out) {
  SHOAL_RETURN_IF_ERROR(plan_textures(slots, in, out));
  SHOAL_RETURN_IF_ERROR(plan_layers(slots, in, plan, out));
  note_effects(out, plan);
  if (out.coverage != CoverageMode::kOpaque && out.base_color_texture.texture != kNoIndex) {
    plan.textures[out.base_color_texture.texture].needs_alpha = true;
  }
  return {};
}

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

bool is_lambert(const Material& m) {
  if (m.metallic > 0 || m.specular > 0 || m.effects != 0) return false;
  for (const TextureSlot* s : texture_slots(m)) {
    if (s->texture != kNoIndex && s != &m.emissive_texture) return false;
  }
  return true;
}

}  // namespace

Result<MaterialPlan> plan_materials(const gltf::Document& document, const std::vector<MaterialUse>& uses) {
  SHOAL_CHECK(uses.size() == document.materials.size() + 1);
  MaterialPlan plan;
  plan.uv_sets.resize(document.materials.size());
  SlotPlanner slots(document, plan);
  for (uint32_t m = 0; m < document.materials.size(); ++m) {
    Material material = convert_factors(document.materials[m]);
    slots.begin(m);
    if (uses[m].used) SHOAL_RETURN_IF_ERROR(plan_material(slots, document.materials[m], plan, material));
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
    if (is_lambert(material)) material.flags |= kMaterialLambert;
    if (uses[m].vertex_colors) material.flags |= kMaterialVertexColors;
  }
}

}  // namespace shoal
