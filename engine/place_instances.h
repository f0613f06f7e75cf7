// Objects and the nodes that show them become the resident top tree: instances with their inverse maps and world
// bounds, a tree over them, and below it the tree of every object.
// Called by engine/build_scene. Cost: O(instances log instances).
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "engine/affine_double.h"
#include "treelets/build_object.h"
#include "treelets/top_tree.h"

namespace shoal {

struct PlacedInstance {
  Instance instance;  ///< root_node and tree_child are set by assemble_top_tree()
  std::vector<Instance> keys;  ///< where it stands at even times; empty: it does not move
  Bounds3 bounds;     ///< world space, encloses every point of the object as any rounding of the map shows it
};

/// The object with `object_bounds`, shown through `to_world` (rounded to float first; the inverse belongs to the
/// rounded map). Nothing when the map has no inverse in float: the instance would be flat.
std::optional<PlacedInstance> place_instance(uint32_t object, const Bounds3& object_bounds,
                                             const AffineDouble& to_world);

/// The same for an instance that moves: `keys` at even times, at least two. Nothing where one of them has no inverse.
std::optional<PlacedInstance> place_moving_instance(uint32_t object, const Bounds3& object_bounds,
                                                    std::span<const AffineDouble> keys);

struct TopTables {
  std::vector<TopNode> nodes;
  std::vector<TreeletEntry> entries;
  std::vector<Instance> instances;
};

/// Node 0 is the root of the tree over instances; the objects' nodes and entries follow, rebased.
/// Fails with: kInput (more nodes than a cursor can name).
Result<TopTables> assemble_top_tree(std::span<const BuiltObject> objects, std::vector<PlacedInstance> placed);

}  // namespace shoal
