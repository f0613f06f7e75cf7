// The part of the shader that AOVs of surfaces call for: one call a vertex, for paths that seek it only.
#include <algorithm>

#include "engine/material_sample.h"
#include "engine/shade.h"

namespace shoal {
namespace {

/// Materials that are smoother, and hardly anything but metal and glass, are looked through: their lobe is a few pixels
/// wide, so what is seen in them has edges that a denoiser should know of. Chosen.
constexpr float kSmoothRoughness = 0.1f, kSpecularShare = 0.95f;

}  // namespace

Vec3 passed_color(const PathState& path) {
  // What has one wavelength only is tinted by it, which is no colour of a surface.
  if ((path.medium & kPathOneWavelength) != 0) return Vec3(1);
  return glm::clamp(path.throughput, 0.0f, 1.0f);
}

Status Shader::note_features(const PathState& path, const Surface& surface, const Material& material, uint32_t effects,
                             TextureContext& textures) {
  const uint32_t mapped = ~options_->effects.off & kEffectNormalMap;
  LayeredSample values;
  SHOAL_ASSIGN_OR_RETURN(static_cast<MaterialSample&>(values), sample_material(material, surface, textures));
  SHOAL_ASSIGN_OR_RETURN(features_.normal, sample_normal(material, surface, textures, mapped != 0));
  const bool unlit = (effects & material.effects & kEffectUnlit) != 0;
  if (!unlit && (effects & kLayerEffects) != 0) {
    SHOAL_RETURN_IF_ERROR(sample_layers(layers_of(material), material, (effects & kLayerEffects) | mapped, surface,
                                        textures, values));
  }
  const float dielectric = 1 - values.metallic;
  const float scattered = dielectric * (1 - values.transmission) * values.diffuse_transmission;
  const Vec3 albedo = glm::mix(values.base_color, values.diffuse_transmission_color, scattered);
  features_.albedo = glm::clamp(albedo * passed_color(path), 0.0f, 1.0f);
  features_.position = surface.position.point;
  features_.distance = glm::length(surface.position.point - path.origin);
  features_.material = surface.attributes.material;
  features_.see_through = !unlit && values.roughness <= kSmoothRoughness &&
                          values.metallic + dielectric * values.transmission >= kSpecularShare;
  return {};
}

}  // namespace shoal
