// Builds the tree over the lights of a scene (engine/light_tree.h), top down: of 12 buckets an axis, the split with the
// least light_split_cost(); the same lights give the same tree whatever the number of threads. Called by
// engine/light_sampler when the scene is made ready to be shaded. Cost: n log n, by all threads.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/light_tree.h"

namespace shoal {

/// One light while the tree is built: LightBounds in floats.
struct TreeLight {
  float lo[3], hi[3];
  float axis[3];
  float angle;           ///< NormalCone::kEveryWay for a light without an axis
  float emission_angle;
  float strength;        ///< > 0; those of all lights together must be finite
  uint32_t light;        ///< its index
  uint32_t both_sides;
};

/// Requires: finite boxes. Beside the tree there are the lights: sizeof(TreeLight) each. `light_count`: all indices are below it.
LightTree build_light_tree(std::vector<TreeLight> lights, uint32_t light_count, unsigned threads);

/// Of a tree of so many lights among `light_count`.
uint64_t light_tree_bytes(uint64_t lights, uint64_t light_count);

}  // namespace shoal
