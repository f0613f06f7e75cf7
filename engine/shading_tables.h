// What all threads share while shading: the inside of ShadingTables, apart from its interface (engine/shade.h) so
// that the render loops do not see it. Included by engine/shade.cpp and engine/shading_tables.cpp.
#pragma once

#include <memory>
#include <optional>

#include "engine/energy_table.h"
#include "engine/environment.h"
#include "engine/layered_bsdf.h"
#include "engine/light_sampler.h"
#include "engine/shade.h"
#include "engine/shaded_materials.h"

namespace shoal {

struct ShadingTables::Impl {
  Impl(const Scene& scene, const EffectChoice& effects) : materials(scene, effects) {}

  ShadedMaterials materials;
  Environment environment;
  std::optional<LightSampler> lights;  ///< always set once created; it refers to `environment`
  const EnergyTable* energy = nullptr;  ///< set when some material has a specular lobe
  std::shared_ptr<const GlassTable> glass;  ///< set when some material refracts
  const SheenTable* sheen = nullptr;    ///< set when some material has sheen
  const AnisotropyTable* anisotropy = nullptr;  ///< set when some material is anisotropic
  bool coverage = false;              ///< some material is there in part
  bool lights_hit_by_chance = false;  ///< emitters or an environment: a bounce that scatters no more may find light

  const EnergyTable* energy_table() const { return energy; }
  LobeTables lobe_tables() const { return {energy, glass.get(), sheen, anisotropy}; }
};

}  // namespace shoal
