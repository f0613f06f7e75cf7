#include "engine/shaded_materials.h"

namespace shoal {
namespace {

void take_textures(Material& m) {
  for (TextureSlot* slot : {&m.base_color_texture, &m.metallic_roughness_texture, &m.normal_texture,
                            &m.emissive_texture, &m.specular_texture, &m.specular_color_texture}) {
    slot->texture = kNoIndex;
  }
}

void take_textures(MaterialLayers& l) {
  for (TextureSlot* slot :
       {&l.transmission_texture, &l.clearcoat_texture, &l.clearcoat_roughness_texture, &l.clearcoat_normal_texture,
        &l.sheen_color_texture, &l.sheen_roughness_texture, &l.anisotropy_texture, &l.iridescence_texture,
        &l.film_texture, &l.diffuse_transmission_texture, &l.diffuse_transmission_color_texture}) {
    slot->texture = kNoIndex;
  }
}

void take_effects(Material& m, uint32_t off) {
  if ((off & kEffectTextures) != 0) take_textures(m);
  if ((off & kEffectReflection) != 0) m.metallic = m.specular = 0;
  if ((off & kEffectEmission) != 0) {
    m.emissive[0] = m.emissive[1] = m.emissive[2] = m.emission_weight = 0;
    m.flags &= ~uint32_t{kMaterialEmits};
  }
  if ((off & kEffectCoverage) != 0) m.coverage = CoverageMode::kOpaque;
}

}  // namespace

ShadedMaterials::ShadedMaterials(const Scene& scene, const EffectChoice& choice)
    : materials_(scene.materials), layers_(scene.material_layers) {
  if ((choice.off & kMaterialSceneEffects) == 0) return;
  changed_ = scene.materials;
  for (Material& m : changed_) take_effects(m, choice.off);
  materials_ = changed_;
  if ((choice.off & kEffectTextures) == 0) return;
  changed_layers_ = scene.material_layers;
  for (MaterialLayers& l : changed_layers_) take_textures(l);
  layers_ = changed_layers_;
}

}  // namespace shoal
