// What is around the kernels of packets: their state, and the slow way where a scene is too large for it. Made by
// trace_packets.cpp and trace_packets_reorder.cpp. Thread rule: SceneTraversal's.
#pragma once

#include "treelets/packet_rows.h"

namespace shoal {

using WalkPackets = void (*)(const SceneTables& tables, PacketWalkState& state, uint32_t packet_rays,
                             RayStream& stream, TraceCounters& counters, TouchLog* touches);

class PacketTraversal final : public SceneTraversal {
 public:
  /// Requires: make_packet_traversal()'s.
  PacketTraversal(const TopTree& tree, PageTable pages, TriangleTest test, uint32_t packet_rays, WalkPackets walk,
                  TouchLog* touches);
  void trace(RayStream& stream, TraceCounters& counters) override;

 private:
  const TopTree& tree_;
  PageTable pages_;
  TriangleTest test_;
  uint32_t packet_rays_;
  WalkPackets walk_;
  TouchLog* touches_;
  std::unique_ptr<PacketWalkState> state_;
};

}  // namespace shoal
