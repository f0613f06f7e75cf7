// What all threads share while shading: the inside of ShadingTables, apart from its interface (engine/shade.h) so
// that the render loops do not see it. Included by engine/shade.cpp and engine/shading_tables.cpp.
#pragma once

#include <optional>

#include "engine/energy_table.h"
#include "engine/environment.h"
#include "engine/layered_bsdf.h"
#include "engine/light_sampler.h"
#include "engine/shade.h"

namespace shoal {

struct ShadingTables::Impl {
  Environment environment;
  std::optional<LightSampler> lights;  ///< always set once created; it refers to `environment`
  std::optional<EnergyTable> energy;   ///< set when some material has a specular lobe
  std::optional<GlassTable> glass;     ///< set when some material refracts
  std::optional<SheenTable> sheen;     ///< set when some material has sheen
  std::optional<AnisotropyTable> anisotropy;  ///< set when some material is anisotropic
  bool lights_hit_by_chance = false;  ///< emitters or an environment: a bounce that scatters no more may find light

  const EnergyTable* energy_table() const { return energy ? &*energy : nullptr; }
  LobeTables lobe_tables() const {
    return {energy_table(), glass ? &*glass : nullptr, sheen ? &*sheen : nullptr,
            anisotropy ? &*anisotropy : nullptr};
  }
};

}  // namespace shoal
