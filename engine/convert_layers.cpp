#include "engine/convert_layers.h"

#include <cmath>

#include "engine/dispersion.h"
#include "engine/flatten_nodes.h"
#include "engine/math.h"

namespace shoal {

namespace {

constexpr double kFloatMax = std::numeric_limits<float>::max();
/// A colour of 0 lets nothing pass after any distance; what passes the attenuation distance is 2^-40 then.
constexpr float kBlackLog2 = -40;

float unit(double v) { return clamped_float(v, 0, 1); }

/// KHR_materials_volume: transmittance = attenuationColor^(x / attenuationDistance), as log2 of it for x = 1.
void set_absorption(const gltf::MaterialExtensions& in, MaterialLayers& out) {
  if (in.attenuation_distance <= 0) return;
  for (int i = 0; i < 3; ++i) {
    const float color = unit(in.attenuation_color[i]);
    const double log2_color = color >= 1 ? 0.0 : std::max(kBlackLog2, log2_of(std::max(color, 1e-20f)));
    out.absorption[i] = clamped_float(log2_color / in.attenuation_distance, -1e30, 0);
  }
}

uint32_t transmitting_effects(const gltf::Material& in) {
  const gltf::MaterialExtensions& x = in.more;
  const bool metal = in.metallic >= 1 && !in.metallic_roughness_texture;  // lets nothing pass
  uint32_t effects = 0;
  if (metal) return 0;
  if (x.transmission > 0) effects |= kEffectTransmission;
  if (x.diffuse_transmission > 0) effects |= kEffectDiffuseTransmission;
  if (effects != 0 && x.has_volume) effects |= kEffectVolume;
  if (x.transmission > 0 && x.has_volume && x.dispersion > 0) effects |= kEffectDispersion;
  return effects;
}

uint32_t layer_effects(const gltf::Material& in) {
  const gltf::MaterialExtensions& x = in.more;
  if (x.unlit) return 0;
  uint32_t effects = transmitting_effects(in);
  if (x.clearcoat > 0) effects |= kEffectClearcoat;
  if (x.sheen_color[0] > 0 || x.sheen_color[1] > 0 || x.sheen_color[2] > 0) effects |= kEffectSheen;
  const bool reflects = in.specular > 0 || in.metallic > 0;
  if (x.anisotropy > 0 && reflects) effects |= kEffectAnisotropy;
  if (x.iridescence > 0 && reflects) effects |= kEffectIridescence;
  return effects;
}

MaterialLayers convert_factors(const gltf::Material& in) {
  const gltf::MaterialExtensions& x = in.more;
  MaterialLayers out;
  // KHR_materials_ior: 0 stands for infinity. Nothing enters such a material; any large number will do.
  out.ior = in.ior == 0 ? kLargestIor : clamped_float(in.ior, 1, kLargestIor);
  out.transmission = unit(x.transmission);
  out.dispersion = clamped_float(x.dispersion, 0, kFloatMax);
  out.volume = x.has_volume ? 1 : 0;
  set_absorption(x, out);
  out.clearcoat = unit(x.clearcoat), out.clearcoat_roughness = unit(x.clearcoat_roughness);
  out.clearcoat_normal_scale = clamped_float(x.clearcoat_normal_scale, -kFloatMax, kFloatMax);
  for (int i = 0; i < 3; ++i) {
    out.sheen_color[i] = unit(x.sheen_color[i]);
    out.diffuse_transmission_color[i] = unit(x.diffuse_transmission_color[i]);
  }
  out.sheen_roughness = unit(x.sheen_roughness);
  out.anisotropy = unit(x.anisotropy);
  const SinCos turn = sin_cos(clamped_float(x.anisotropy_rotation, -1e4, 1e4));
  out.anisotropy_cos = std::clamp(turn.cos, -1.0f, 1.0f), out.anisotropy_sin = std::clamp(turn.sin, -1.0f, 1.0f);
  out.iridescence = unit(x.iridescence);
  out.iridescence_ior = clamped_float(x.iridescence_ior, 1, kLargestIor);
  out.film_minimum = clamped_float(x.film_minimum, 0, kFloatMax);
  out.film_maximum = clamped_float(x.film_maximum, 0, kFloatMax);
  out.diffuse_transmission = unit(x.diffuse_transmission);
  return out;
}

}  // namespace

Status plan_layers(SlotPlanner& slots, const gltf::Material& in, MaterialPlan& plan, Material& out) {
  const uint32_t effects = layer_effects(in);
  if (effects == 0) return {};
  const gltf::MaterialExtensions& x = in.more;
  MaterialLayers row = convert_factors(in);
  const auto calls = [&](uint32_t effect) { return (effects & effect) != 0; };
  const bool coat = calls(kEffectClearcoat), sheen = calls(kEffectSheen), film = calls(kEffectIridescence);
  const bool diffuse = calls(kEffectDiffuseTransmission);
  SHOAL_RETURN_IF_ERROR(
      slots.slot(x.transmission_texture, calls(kEffectTransmission), false, row.transmission_texture));
  SHOAL_RETURN_IF_ERROR(slots.slot(x.clearcoat_texture, coat, false, row.clearcoat_texture));
  SHOAL_RETURN_IF_ERROR(slots.slot(x.clearcoat_roughness_texture, coat && row.clearcoat_roughness > 0, false,
                                   row.clearcoat_roughness_texture));
  SHOAL_RETURN_IF_ERROR(slots.slot(x.clearcoat_normal_texture, coat && row.clearcoat_normal_scale != 0, false,
                                   row.clearcoat_normal_texture));
  SHOAL_RETURN_IF_ERROR(slots.slot(x.sheen_color_texture, sheen, true, row.sheen_color_texture));
  SHOAL_RETURN_IF_ERROR(slots.slot(x.sheen_roughness_texture, sheen && row.sheen_roughness > 0, false,
                                   row.sheen_roughness_texture));
  SHOAL_RETURN_IF_ERROR(slots.slot(x.anisotropy_texture, calls(kEffectAnisotropy), false, row.anisotropy_texture));
  SHOAL_RETURN_IF_ERROR(slots.slot(x.iridescence_texture, film, false, row.iridescence_texture));
  SHOAL_RETURN_IF_ERROR(slots.slot(x.film_texture, film, false, row.film_texture));
  SHOAL_RETURN_IF_ERROR(slots.slot(x.diffuse_transmission_texture, diffuse, false, row.diffuse_transmission_texture));
  SHOAL_RETURN_IF_ERROR(
      slots.slot(x.diffuse_transmission_color_texture, diffuse, true, row.diffuse_transmission_color_texture));
  out.effects |= effects;
  out.layers = static_cast<uint32_t>(plan.layers.size());
  plan.layers.push_back(row);
  return {};
}

bool has_transform(const MaterialLayers& l) {
  for (const TextureSlot* s : texture_slots(l)) {
    if (s->transform != 0) return true;
  }
  return false;
}

}  // namespace shoal
