#include "engine/shading_tables.h"

#include <mutex>

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

/// One that is the same for every scene: made by whoever first asks for it.
template <class Table>
const Table& made_once(unsigned threads) {
  static const Table table(threads);
  return table;
}

/// The last one is kept: pictures of one scene, such as the probes of engine/light_unlit_scene, ask for the same.
std::shared_ptr<const GlassTable> glass_table(std::vector<float> indices, unsigned threads) {
  static std::mutex mutex;
  static std::vector<float> kept_indices;
  static std::shared_ptr<const GlassTable> kept;
  const std::lock_guard lock(mutex);
  if (kept == nullptr || indices != kept_indices) {
    kept = std::make_shared<const GlassTable>(indices, threads);
    kept_indices = std::move(indices);
  }
  return kept;
}

Result<Environment> make_environment(FileSystem& fs, const EnvironmentOptions& options) {
  switch (options.kind) {
    case EnvironmentOptions::Kind::kNone:
      break;
    case EnvironmentOptions::Kind::kConstant:
      return Environment(options.radiance * options.intensity);
    case EnvironmentOptions::Kind::kImage: {
      SHOAL_ASSIGN_OR_RETURN(ImageF image, read_hdr_image(fs, options.path, kMaxEnvironmentPixels));
      return Environment(std::move(image), options.rotation, options.intensity);
    }
  }
  return Environment();
}

}  // namespace

ShadingTables::ShadingTables(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ShadingTables::~ShadingTables() = default;

Result<std::unique_ptr<ShadingTables>> ShadingTables::create(FileSystem& fs, const Scene& scene,
                                                             const ShadingOptions& options, unsigned threads) {
  const EffectChoice& effects = options.effects;
  auto impl = std::make_unique<Impl>(scene, effects);
  if ((effects.off & kEffectEnvironment) == 0) {
    SHOAL_ASSIGN_OR_RETURN(impl->environment, make_environment(fs, options.environment));
  }
  const std::span<const Material> materials = impl->materials.materials();
  LightSources sources{scene.emitters, scene.lights, materials};
  if ((effects.off & kEffectEmission) != 0) sources.emitters = {};
  if ((effects.off & kEffectPunctualLights) != 0) sources.lights = {};
  impl->lights.emplace(scene, sources, impl->environment, threads, options.light_choice);
  impl->lights_hit_by_chance = !impl->environment.black();
  impl->coverage = (effects.on & kEffectCoverage) != 0;
  const uint32_t called = effects_called_for(scene, effects);
  bool specular = (called & (kLayerEffects | kEffectReflection)) != 0;
  for (const Material& material : materials) {
    if ((material.flags & kMaterialEmits) != 0) impl->lights_hit_by_chance = true;
    // An unlit surface shines towards whoever sees it.
    if ((effects.of(material.effects) & kEffectUnlit) != 0) impl->lights_hit_by_chance = true;
    if (material.coverage != CoverageMode::kOpaque) impl->coverage = true;
    specular = specular || has_specular_lobe(material);
  }
  if (specular) impl->energy = &made_once<EnergyTable>(threads);
  if (std::vector<float> indices = glass_indices(scene, effects); !indices.empty()) {
    impl->glass = glass_table(std::move(indices), threads);
  }
  if ((called & kEffectSheen) != 0) impl->sheen = &made_once<SheenTable>(threads);
  if ((called & kEffectAnisotropy) != 0) impl->anisotropy = &made_once<AnisotropyTable>(threads);
  return std::unique_ptr<ShadingTables>(new ShadingTables(std::move(impl)));
}

uint64_t ShadingTables::resident_bytes() const {
  return sizeof(Impl) + impl_->materials.resident_bytes() + impl_->environment.resident_bytes() +
         impl_->lights->resident_bytes() + (impl_->energy ? impl_->energy->resident_bytes() : 0) +
         (impl_->glass ? impl_->glass->resident_bytes() : 0) + (impl_->sheen ? impl_->sheen->resident_bytes() : 0) +
         (impl_->anisotropy ? impl_->anisotropy->resident_bytes() : 0);
}

bool ShadingTables::has_lights() const { return !impl_->lights->empty(); }
bool ShadingTables::has_coverage() const { return impl_->coverage; }

}  // namespace shoal
