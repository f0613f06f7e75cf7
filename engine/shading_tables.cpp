#include "engine/shading_tables.h"

#include "engine/dispersion.h"

namespace shoal {
namespace {

bool has_specular_lobe(const Material& material) { return material.metallic > 0 || material.specular > 0; }

/// The indices of refraction of the volumes that light is refracted into, as they are shaded.
std::vector<float> glass_indices(const Scene& scene, const EffectChoice& choice) {
  std::vector<float> indices;
  for (const Material& material : scene.materials) {
    const uint32_t effects = choice.of(material.effects);
    const bool refracts = (effects & kEffectTransmission) != 0 && (effects & kEffectVolume) != 0;
    if (!refracts || (material.effects & kLayerEffects) == 0) continue;
    const MaterialLayers& layers = scene.material_layers[material.layers];
    if (layers.volume == 0) continue;
    indices.push_back(layers.ior);
    if ((effects & kEffectDispersion) == 0 || !(layers.dispersion > 0)) continue;
    for (const float wave : {kShortestWave, kLongestWave}) {
      indices.push_back(dispersed_ior(layers.ior, layers.dispersion, wave));
    }
  }
  return indices;
}

}  // namespace

ShadingTables::ShadingTables(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ShadingTables::~ShadingTables() = default;

Result<std::unique_ptr<ShadingTables>> ShadingTables::create(FileSystem& fs, const Scene& scene,
                                                             const ShadingOptions& options, unsigned threads) {
  auto impl = std::make_unique<Impl>();
  switch (options.environment.kind) {
    case EnvironmentOptions::Kind::kNone:
      break;
    case EnvironmentOptions::Kind::kConstant:
      impl->environment = Environment(options.environment.radiance * options.environment.intensity);
      break;
    case EnvironmentOptions::Kind::kImage: {
      SHOAL_ASSIGN_OR_RETURN(ImageF image, read_hdr_image(fs, options.environment.path, kMaxEnvironmentPixels));
      impl->environment = Environment(std::move(image), options.environment.rotation, options.environment.intensity);
      break;
    }
  }
  const bool planted = options.light_choice == LightChoice::kTree;
  impl->lights.emplace(scene, impl->environment, threads, planted ? LightSampler::kFewLights : UINT64_MAX);
  impl->lights_hit_by_chance = !impl->environment.black();
  for (const Material& material : scene.materials) {
    if ((material.flags & kMaterialEmits) != 0) impl->lights_hit_by_chance = true;
    // An unlit surface shines towards whoever sees it.
    if ((options.effects.of(material.effects) & kEffectUnlit) != 0) impl->lights_hit_by_chance = true;
    if (has_specular_lobe(material) && !impl->energy) impl->energy.emplace();
  }
  const uint32_t called = effects_called_for(scene, options.effects);
  if ((called & kLayerEffects) != 0 && !impl->energy) impl->energy.emplace();
  if (std::vector<float> indices = glass_indices(scene, options.effects); !indices.empty()) {
    impl->glass.emplace(std::move(indices));
  }
  if ((called & kEffectSheen) != 0) impl->sheen.emplace();
  if ((called & kEffectAnisotropy) != 0) impl->anisotropy.emplace();
  return std::unique_ptr<ShadingTables>(new ShadingTables(std::move(impl)));
}

uint64_t ShadingTables::resident_bytes() const {
  return sizeof(Impl) + impl_->environment.resident_bytes() + impl_->lights->resident_bytes() +
         (impl_->energy ? impl_->energy->resident_bytes() : 0) + (impl_->glass ? impl_->glass->resident_bytes() : 0) +
         (impl_->sheen ? impl_->sheen->resident_bytes() : 0) +
         (impl_->anisotropy ? impl_->anisotropy->resident_bytes() : 0);
}

bool ShadingTables::has_lights() const { return !impl_->lights->empty(); }

}  // namespace shoal
