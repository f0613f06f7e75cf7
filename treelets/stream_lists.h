// The state of treelets/trace_stream: the rays of a stream, prepared, and the lists of those that are in a node
// (Wald, Gribble, Boulos & Kensler 2007, "SIMD Ray Stream Tracing"; by a ray against all children of a wide node as
// Tsakok 2009, "Faster Incoherent Rays: Multi-BVH Ray Stream Tracing"). Plain arrays, about 2 MiB. One StreamState
// a thread.
//
// Lists lie in one array as on a stack: that of the node to be visited next is the last, and makes room for those
// of its children. Seven rays in eight may wait at each level, so the array would have to be huge in the worst
// case; instead a list whose children might not have room is halved, and the halves go one after the other.
#pragma once

#include "treelets/ray_space.h"
#include "treelets/scene_kernels.h"
#include "treelets/scene_traversal.h"

namespace shoal {

struct StreamItem {
  float near;    ///< where the ray enters
  uint32_t ray;  ///< its number in the stream
};

/// Room for the lists of one ray, whose list cannot be halved; and in all.
inline constexpr uint32_t kStreamReserve = kSceneStack, kStreamItems = 32 * kStreamRays + kStreamReserve;
/// A list is halved at most so often: rays of a stream are 2^11.
inline constexpr uint32_t kMostHalvings = 11;
static_assert(kStreamRays <= 1u << kMostHalvings && kStreamItems - kStreamReserve >= 8 * 2 * kStreamRays);

/// What waits at a node.
struct StreamList {
  uint32_t ref;
  uint32_t first, count;  ///< of StreamState::items
};

/// What is on the stack above `base` is seen in these spaces and, where it says so, in this treelet.
struct StreamScope {
  uint32_t base;
  bool in_treelet;
  const RaySpace* spaces;
  TreeletEntry entry;
  const std::byte *page, *leaves;
  const QuantizedNode* nodes;
};

struct StreamState {
  Ray* rays[kStreamRays];
  RayWork work[kStreamRays];
  bool gone[kStreamRays];  ///< the answer is known
  RaySpace world[kStreamRays], object[kStreamRays];
  uint32_t current[kStreamRays];  ///< rays in the node that is visited
  uint32_t count;                 ///< of them
  StreamItem children[8][kStreamRays];
  StreamItem items[kStreamItems];
  uint32_t used;  ///< of them
  StreamList stack[kSceneStack + kMostHalvings];
  uint32_t size;
  StreamScope scopes[3];  ///< the world, an object, a treelet
  uint32_t scope_count;
};

}  // namespace shoal
