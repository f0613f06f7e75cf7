// Other ways than SceneTracer's (treelets/trace_scene.h) of tracing the rays of a stream through a scene in memory,
// to compare: each in its file, all to the same bits. Of every kind of ray, triangle test, position and coverage,
// under instances and in motion. Called by engine/render_packet, render_packet_reorder, render_stream.
//
// clang-format off
//   packet          treelets/trace_packets: N rays, one stack; a node is entered when the first ray that may enters it
//   packet-reorder  treelets/trace_packets_reorder: every ray is known to enter or not; where at most half of the lanes
//                   have a ray that does, those are copied together and go on by themselves
//   stream          treelets/trace_stream: a list of rays for each node
// clang-format on
//
// Properties and assumptions
//   order      rays end in any order and do not affect each other.
//   threads    any number, each with a traversal and a stream of its own.
//   memory     fixed: what the functions below say.
//   leaves     in all three a ray at a time, its triangles in lanes: by the kernels of single rays.
#pragma once

#include <memory>

#include "treelets/trace_scene.h"

namespace shoal {

class SceneTraversal {
 public:
  virtual ~SceneTraversal() = default;
  /// Until the stream has no ray left and none is under way. Counts lanes (TraceCounters::simd_lanes_count): those
  /// that tests of boxes and triangles had, and of those the ones in which a ray entered the box or met a leaf's
  /// triangle.
  virtual void trace(RayStream& stream, TraceCounters& counters) = 0;
};

inline constexpr uint32_t kLeastPacketRays = 16, kMostPacketRays = 256;
/// Rays of a stream. Fewer fill the lists of lower nodes worse, more leave the core's cache (docs/decisions/0028).
inline constexpr uint32_t kStreamRays = 2048;

/// Keep references to the tree, the table and `touches`, which is told what is touched where somebody measures that by
/// TriangleTest::kWatertight (treelets/trace_touching.h). Requires: `packet_rays` is a power of two from kLeastPacketRays
/// to kMostPacketRays.
std::unique_ptr<SceneTraversal> make_packet_traversal(const TopTree& tree, PageTable pages, TriangleTest test,
                                                      uint32_t packet_rays, TouchLog* touches = nullptr);
std::unique_ptr<SceneTraversal> make_reordering_traversal(const TopTree& tree, PageTable pages, TriangleTest test,
                                                          uint32_t packet_rays, TouchLog* touches = nullptr);
std::unique_ptr<SceneTraversal> make_stream_traversal(const TopTree& tree, PageTable pages, TriangleTest test,
                                                      TouchLog* touches = nullptr);

/// Of a traversal of either kind of packet, of the largest size; of one by streams.
uint64_t packet_traversal_bytes();
uint64_t stream_traversal_bytes();

}  // namespace shoal
