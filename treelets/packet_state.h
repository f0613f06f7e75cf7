// The state of packets of rays on their way through a scene in memory: what the kernels of treelets/trace_scene_packets
// keep from step to step. Plain arrays, a lane a ray, sized for the widest vectors. One PacketState a thread.
#pragma once

#include "treelets/ray_space.h"
#include "treelets/scene_kernels.h"

namespace shoal {

/// Rays of a packet at most; targets with narrower vectors have smaller packets.
inline constexpr uint32_t kMaxPacketRays = 16;
/// Packets are filled apart for each sign of the direction and each longest axis.
inline constexpr uint32_t kPacketKinds = 8 * 3;
/// Packets traced in turn: while one waits for memory the others go on.
inline constexpr uint32_t kPacketsInTurn = 4;

/// What is still to visit, and which rays enter it where.
struct alignas(64) PacketEntry {
  float near[kMaxPacketRays];
  uint32_t ref;
  uint32_t rays;  ///< a bit each
};

/// Rays on the same kind of way, ready to be traced together.
struct Packet {
  alignas(64) float slope[3][kMaxPacketRays];
  float near_bias[3][kMaxPacketRays];
  float far_bias[3][kMaxPacketRays];
  float origin[3][kMaxPacketRays];  ///< along kx, ky, kz
  float shear_x[kMaxPacketRays], shear_y[kMaxPacketRays];
  float inverse[3][kMaxPacketRays], far_inverse[3][kMaxPacketRays];  ///< as origin
  float direction[3][kMaxPacketRays], world_origin[3][kMaxPacketRays];  ///< along x, y, z
  float pad[kMaxPacketRays];
  float t[kMaxPacketRays];
  Ray* rays[kMaxPacketRays];
  uint32_t node_tests[kMaxPacketRays], triangle_tests[kMaxPacketRays], treelets[kMaxPacketRays];
  /// Of the lanes in `ready`, a bit each; only what tests of one ray against a leaf read: origin, inverse, direction along
  /// kz, axes, shear and pad.
  RaySpace space[kMaxPacketRays];
  uint32_t ready;
  uint32_t count;        ///< of rays
  uint32_t alive;        ///< lanes with more to find, a bit each: any-hit rays leave at their hit
  uint32_t extreme;      ///< lanes that go another way
  uint32_t negative[3];  ///< of all rays: RaySpace::negative
  uint32_t k[3];         ///< of all rays: kx, ky, kz
  bool in_treelet;  ///< what is visited is in `entry`'s treelet, seen through the next three
  TreeletEntry entry;
  const std::byte* page;
  const std::byte* leaves;
  const QuantizedNode* nodes;
  uint32_t size, base;  ///< of the stack: what lies above `base` is in the treelet
  PacketEntry stack[kSceneStack];
};

/// Rays that wait for others of their kind.
struct WaitingRays {
  Ray* rays[kMaxPacketRays];
  uint32_t count = 0;
};

struct PacketState {
  Packet packets[kPacketsInTurn];
  WaitingRays waiting[kPacketKinds];
};

}  // namespace shoal
