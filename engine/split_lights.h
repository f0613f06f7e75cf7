// Where sets of lights are parted while the tree over them is built, each time where the two sides cost least
// (light_cost()). Called by engine/build_light_tree. Pure: the same lights in the same order are parted the same way.
// Cost: about 10 ns a cluster and axis, and as much for each side that is weighed.
#pragma once

#include <cstddef>
#include <span>

#include "engine/cluster_lights.h"

namespace shoal {

/// Of 12 buckets in each axis; clusters are moved, and the result is how many are left of the split: both sides have
/// some. Requires: two clusters, and finite boxes.
size_t split_clusters(std::span<LightCluster> clusters);

/// Between two neighbours of those in order. Requires: 2 to kLargestCluster lights.
size_t split_run(std::span<const TreeLight> lights);

}  // namespace shoal
