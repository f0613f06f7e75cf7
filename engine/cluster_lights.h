// Gathers neighbouring lights before the tree over them is built: sorted along a Morton curve of 2^10 steps an axis,
// and cut into its aligned cells until each has few. Building over clusters, and inside each along the curve, is less
// work than building over lights. Called by engine/build_light_tree. Pure. Cost: some 100 ns a light, and
// memory for a copy of all.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/light_sums.h"

namespace shoal {

struct LightCluster {
  LightSums sums;
  uint32_t first = 0, count = 0;  ///< of its lights
};

inline constexpr uint32_t kLargestCluster = 16;
/// How many lights a cluster has at most, in a tree of so many. Chosen: the noise of pictures grows by some percent
/// with the size of clusters, so those of few lights, which are soon done, have one each.
constexpr uint32_t cluster_size(uint64_t lights) {
  return static_cast<uint32_t>(lights < 16384 ? 1 : lights / 8192 < kLargestCluster ? lights / 8192 : kLargestCluster);
}

/// Sorts the lights; their clusters in that order. A cluster has more than `most` lights only if all are in one of the
/// curve's cells, and then it is not all lights, unless those are in one place. Two neighbours together have more than
/// `most`. Requires: a light.
std::vector<LightCluster> cluster_lights(std::span<TreeLight> lights, uint32_t most);

/// What cluster_lights() needs, and leaves, at most, in a tree of so many lights.
uint64_t clustering_bytes(uint64_t lights);

}  // namespace shoal
