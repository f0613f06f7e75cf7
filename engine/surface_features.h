// What a vertex shows of its surface, for AOVs (docs/aovs.md). Filled by engine/shade_features for paths that seek it,
// read by engine/render_worker_aovs.
#pragma once

#include <cstdint>

#include "treelets/vector.h"

namespace shoal {

struct SurfaceFeatures {
  Vec3 position{0};
  Vec3 normal{0};           ///< unit, mapped, on the side seen
  Vec3 albedo{0};           ///< in [0, 1], times what the mirrors and the glass before it left
  float distance = 0;       ///< from where the ray began
  uint32_t material = 0;
  bool see_through = false; ///< a mirror or clear glass: the albedo is that of what is seen in it
};

}  // namespace shoal
