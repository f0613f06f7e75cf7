#include "treelets/packet_traversal.h"

#include <bit>

#include "io/result.h"

namespace shoal {

PacketTraversal::PacketTraversal(const TopTree& tree, PageTable pages, TriangleTest test, uint32_t packet_rays,
                                 WalkPackets walk, TouchLog* touches)
    : tree_(tree),
      pages_(pages),
      test_(test),
      packet_rays_(packet_rays),
      walk_(walk),
      touches_(touches),
      state_(std::make_unique<PacketWalkState>()) {
  SHOAL_CHECK(packet_rays >= kLeastPacketRays && packet_rays <= kMostPacketRays &&
              std::has_single_bit(packet_rays));
}

void PacketTraversal::trace(RayStream& stream, TraceCounters& counters) {
  const SceneTables tables = scene_tables(tree_, pages_, test_);
  if (tree_.nodes().empty() || exceeds_stacks(tree_)) return trace_all_slowly(tables, stream, counters);
  walk_(tables, *state_, packet_rays_, stream, counters, touches_);
}

uint64_t packet_traversal_bytes() { return sizeof(PacketTraversal) + sizeof(PacketWalkState); }

}  // namespace shoal
