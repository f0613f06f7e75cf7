// The ray: one 64-byte line that holds everything traversal needs, so that it can wait in a queue, be
// written to a block and be taken up by any thread. What the integrator needs meanwhile is in engine/path_state.h.
//
// The traversal state is a cursor into the resident top tree (treelets/top_tree.h): the child it took last. At
// every node children are entered in the order (t of entry less its last three bits, slot), which depends on ray
// and node only, so the cursor alone says what has been visited; parents are found through links in the nodes.
// `more` is a cache over it: bit L says whether the node at level L still had children to enter, so that a test of
// its boxes can be left out on the way up. Any number of its bits may be missing (TraversalOptions::more_levels).
#pragma once

#include <cstdint>

#include "treelets/vector.h"

namespace shoal {

inline constexpr uint32_t kNoIndex = 0xffffffffu;

using TreeletId = uint32_t;

/// What a ray has hit, or nothing (instance == kNoIndex). The closest hit is the smallest
/// (t, instance, primitive). Barycentric coordinates are not kept: the shader intersects the one triangle again.
struct Hit {
  uint32_t instance = kNoIndex;
  uint32_t primitive = 0;  ///< global primitive id: order of the triangles in the glTF, degenerate ones counted
  TreeletId treelet = 0;
  uint32_t slot = 0;  ///< place in the treelet: leaf offset in units of 4 bytes << 4 | triangle of the leaf

  bool valid() const { return instance != kNoIndex; }
};

struct alignas(64) Ray {
  Vec3 origin{0};                //  0  world space
  float t = 0;                   // 12  the end of the ray, then of its closest hit; the start is 0 (exclusive)
  Vec3 direction{0};             // 16  world space, any length but zero
  uint32_t path = 0;             // 28  bit 31: kAnyHitBit; the rest is the engine's (engine/path_ray.h)
  Hit hit;                       // 32
  uint32_t cursor = kNoIndex;    // 48  (top node << 3 | slot) of the child taken last; kNoIndex before the start
  uint32_t instance = kNoIndex;  // 52  the instance in whose tree the cursor is
  uint32_t more = 0;             // 56  a bit a level of the top tree: children left to enter
  uint32_t alpha_seed = 0;       // 60  hash of (pixel, sample, bounce, kind), for stochastic coverage; see time()

  static constexpr uint32_t kAnyHitBit = 0x80000000u;
  static constexpr uint32_t kNoCoverage = 0xffffu;  ///< lower half of alpha_seed: every triangle is there
  bool any_hit() const { return (path & kAnyHitBit) != 0; }
  bool has_coverage() const { return (alpha_seed & 0xffffu) != kNoCoverage; }
  /// Of scenes that move: the time of the ray, in [0, 1) of the shutter, is in the upper half of its seed.
  float time() const { return shutter_time(alpha_seed); }
  static float shutter_time(uint32_t bits) { return static_cast<float>(bits >> 16) * 0x1p-16f; }
};
static_assert(sizeof(Ray) == 64 && alignof(Ray) == 64);

/// A ray's end when nothing bounds it. Finite, so that t stays comparable.
inline constexpr float kRayInfinity = std::numeric_limits<float>::max();

}  // namespace shoal
