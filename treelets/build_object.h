// From a soup of triangles to treelets and a tree over them: a binary tree by one of the builders (treelets/bvh_builder.h;
// binned SAH unless another is asked for), collapsed to 8 children, cut into leaf treelets of at most `treelet_bytes`, each
// packed into a page; small neighbours share a treelet.
// Called by engine/build_scene for each object. Parallel inside (oneTBB); the result depends on the input
// and the options only, not on the number of threads. Cost: O(n log n), about 0.7 us of one core and 60 bytes of
// scratch a triangle beside the soup (by binned SAH).
#pragma once

#include <cstdint>
#include <vector>

#include "io/result.h"
#include "treelets/bvh_builder_kind.h"
#include "treelets/coverage.h"
#include "treelets/top_tree.h"
#include "treelets/treelet_sink.h"
#include "treelets/triangle_refs.h"
#include "treelets/triangle_soup.h"

namespace shoal {

struct BuildOptions {
  uint32_t treelet_bytes = 256u << 10;  ///< target of a geometry page, 4 KiB .. 4 MiB; one leaf may exceed it
  uint32_t pages_in_flight = 0;         ///< packed at once, at most; 0: two a thread
  BvhBuilder builder = BvhBuilder::kSah;
};

inline constexpr uint32_t kMinTreeletBytes = 4u << 10;
inline constexpr uint32_t kMaxTreeletBytes = 4u << 20;

/// The tree of one object over its treelets; node and entry indices are local to the object.
struct BuiltObject {
  std::vector<TopNode> nodes;        ///< nodes[0] is the root
  std::vector<TreeletEntry> entries;
  Bounds3 bounds;
  uint64_t triangles_count = 0;      ///< stored
  uint64_t degenerate_count = 0;     ///< skipped: two corners with equal bits, or a corner beyond kMaxCoordinate
  uint64_t leaves_count = 0;
  /// SIMD tests expected of a line that meets the root's box: the sum over wide nodes (resident and in treelets)
  /// and over leaves of the area of their exact box over the root's, one test each. 0 when the root has no area.
  double sah_cost = 0;
};

/// Requires: soup not empty after skipping (an object of only degenerate triangles gives no nodes).
/// `soup` is consumed to bound memory. Fails with: what the sink or the coverage source returns.
Result<BuiltObject> build_object(TriangleSoup&& soup, const BuildOptions& options, const CoverageSource* coverage,
                                 TreeletSink& sink);

/// One instance for the tree over instances.
struct InstanceBounds {
  uint32_t instance = 0;
  Bounds3 bounds;  ///< world space
};

/// The 8-wide tree over instances, by binned SAH whatever builds the objects; its leaves are ChildKind::kInstance. nodes[0] is the root.
std::vector<TopNode> build_instance_tree(std::span<const InstanceBounds> instances);

}  // namespace shoal
