#include "engine/shaded_materials.h"

namespace shoal {
namespace {

template <class Row>
void take_textures(Row& row) {
  for (TextureSlot* slot : texture_slots(row)) slot->texture = kNoIndex;
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
