// Builds the tree over the lights of a scene (engine/light_tree.h), top down: over clusters of neighbours
// (engine/cluster_lights), each time by the cheapest of many splits (engine/split_lights), then in each cluster. The
// same lights give the same tree whatever the number of threads. Called by engine/light_sampler when the scene is made
// ready to be shaded. Cost: some 0.5 us a light, where there are many by all threads.
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
  float range;           ///< nothing arrives further away; infinity: as far as one likes
  uint32_t light;        ///< its index
  uint32_t both_sides;
};

/// Requires: finite boxes. `light_count`: all indices are below it.
LightTree build_light_tree(std::vector<TreeLight> lights, uint32_t light_count, unsigned threads);

/// At most, of a tree of so many lights among `light_count`; without `ranges`, all are infinite.
uint64_t light_tree_bytes(uint64_t lights, uint64_t light_count, bool ranges);
/// What is needed beside it while it is built, the lights included.
uint64_t light_building_bytes(uint64_t lights);

}  // namespace shoal
