// The rays of a packet as treelets/packet_walk-inl.h tests them: rows of 16, a lane each, on every instruction set;
// frames of rows, one for each time that rays were put together anew; and where the walk stands. Plain arrays. One
// PacketWalkState a thread.
#pragma once

#include "treelets/ray_space.h"
#include "treelets/scene_kernels.h"
#include "treelets/scene_traversal.h"

namespace shoal {

inline constexpr uint32_t kRowRays = 16;
/// Frames at once: in the world and in an object's space one, and as often as 16 rows can be halved.
inline constexpr uint32_t kMaxFrames = 2 * 5, kMaxRows = 2 * (16 + 8 + 4 + 2 + 1);
/// One for each frame, one for the treelet.
inline constexpr uint32_t kMaxScopes = kMaxFrames + 1;

struct alignas(64) PacketRow {
  float slope[3][kRowRays], near_bias[3][kRowRays], far_bias[3][kRowRays];  ///< RaySpace
  float t[kRowRays];         ///< Ray::t, or what it was when the ray last was in this frame
  uint16_t ray[kRowRays];    ///< its number in the packet
  uint16_t outer[kRowRays];  ///< where it is in the frame around this one: row << 4 | lane
  uint32_t alive;            ///< lanes with more to find, a bit each
  uint32_t box_tests;        ///< that this row took part in
};

/// Between what the rays of a frame lie along an axis. Origins as node tests move them, towards the box and away
/// from it.
struct AxisInterval {
  float near_origin[2], far_origin[2], slope[2];
  bool mixed;     ///< directions of both signs: nothing can be said
  bool negative;  ///< else: RaySpace::negative
};

struct PacketFrame {
  uint32_t first_row, row_count;
  uint32_t ray_count;
  uint32_t live;  ///< rows with a ray that is alive, a bit each
  float t;        ///< no ray ends behind it
  AxisInterval axis[3];
};

/// A box to be tested when its turn comes.
struct WaitingBox {
  float lo[3], hi[3];
  uint32_t ref;
  uint32_t rows;  ///< with rays that may enter it, a bit each
};

/// What is on the stack above `base` is of this frame and, where it says so, of this treelet.
struct PacketScope {
  PacketFrame* frame;
  uint32_t base;
  bool in_treelet;
  TreeletEntry entry;
  const std::byte *page, *leaves;
  const QuantizedNode* nodes;
};

struct PacketWalkState {
  Ray* rays[kMostPacketRays];
  RayWork work[kMostPacketRays];
  uint32_t box_tests[kMostPacketRays];
  bool gone[kMostPacketRays];       ///< the answer is known
  RaySpace space[kMostPacketRays];  ///< of the object that the ray is in
  PacketRow rows[kMaxRows];
  uint32_t row_count;
  PacketFrame frames[kMaxFrames];
  uint32_t frame_count;
  PacketScope scopes[kMaxScopes];
  uint32_t scope_count;
  WaitingBox stack[kSceneStack];
  uint32_t size;
  Ray* waiting[2][kMostPacketRays];  ///< until a packet is full: closest-hit rays, any-hit rays
  uint32_t waiting_count[2];
};

}  // namespace shoal
