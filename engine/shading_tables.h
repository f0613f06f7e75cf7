// What all threads share while shading: the inside of ShadingTables, apart from its interface (engine/shade.h) so
// that the render loops do not see it. Included by engine/shade.cpp and engine/shading_tables.cpp.
#pragma once

#include <optional>

#include "engine/energy_table.h"
#include "engine/environment.h"
#include "engine/light_sampler.h"
#include "engine/shade.h"

namespace shoal {

struct ShadingTables::Impl {
  Environment environment;
  std::optional<LightSampler> lights;  ///< always set once created; it refers to `environment`
  std::optional<EnergyTable> energy;   ///< set when some material has a specular lobe
  bool lights_hit_by_chance = false;  ///< emitters or an environment: a bounce that scatters no more may find light

  const EnergyTable* energy_table() const { return energy ? &*energy : nullptr; }
};

}  // namespace shoal
