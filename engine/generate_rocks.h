// The surface of a rock: a convex stone cut by planes, roughened by noise, for SurfaceWriter::add_sphere.
// Called by engine/generate_*. The function returned is pure and may be called from many threads.
#pragma once

#include <cstdint>

#include "engine/generate_surfaces.h"

namespace shoal {

struct Rock {
  Vec3 center{0}, radii{1};
  float taper = 0;         ///< -1 .. 1: thinner towards the top (or, negative, the bottom)
  float roughness = 0.5f;  ///< of the noise over the cut planes
  uint32_t seed = 0;
};

/// `cells` as given to add_sphere: the noise's finest octave follows it.
SpherePosition rock_surface(const Rock& rock, uint32_t cells);

}  // namespace shoal
