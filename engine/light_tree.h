// Many lights as a binary tree, from which one is drawn for a place in steps: at each node the side is chosen by how
// much its lights may bring there (Conty Estevez & Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree
// Splitting"; Pharr et al., Physically Based Rendering 4e, section 12.6.3, whose measure this is). One light a draw, no
// splitting. The chance of any light is known again from the place alone, for multiple importance sampling.
//
// A side has chance 0 only if none of its lights can send anything to the place. If that is found of both sides further
// down, no light is drawn: the chances of all lights and of this sum to one. Built by engine/build_light_tree.
// Called by engine/light_sampler. Immutable. A draw, or a chance: two of importance() a level, about log2 n levels,
// one cache line each.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "engine/direction_code.h"
#include "engine/light_bounds.h"

namespace shoal {

/// Where light arrives.
struct LightReceiver {
  Vec3 position{0};
  uint32_t side = 0;  ///< encode_direction() of the normal that light must come from the side of; 0: any side
};

/// What lies below one side of a fork.
///
///   bytes   what
///   0..11   centre of a sphere around the lights
///   12..15  its radius, rounded up; 0: all in one point
///   16..19  sum of intensities
///   20..23  encode_direction() of the cone's axis
///   24..27  cosines: bits 0..14 of the cone's angle, 15..29 of the emission angle, 30: both sides of the axis
///   28..31  bit 31: one light, by its index; else a fork
struct LightNode {
  float center[3] = {};
  float radius = 0;
  float strength = 0;
  uint32_t axis = 0;
  uint32_t cosines = 0;
  uint32_t child = 0;

  static constexpr uint32_t kLeafBit = 0x80000000u;
};
static_assert(sizeof(LightNode) == 32);

/// The box as a sphere, the cone with the error of its axis; nothing is smaller than in `bounds`.
LightNode pack_light_node(const LightBounds& bounds, uint32_t child);

/// An estimate of what the lights of a node bring to a place; 0: nothing for certain. `range`: so far from itself a light
/// of the node reaches at most.
class LightImportance {
 public:
  explicit LightImportance(const LightReceiver& receiver);
  double operator()(const LightNode& node, float range = std::numeric_limits<float>::infinity()) const;

 private:
  glm::dvec3 position_, normal_{0};
  bool has_side_;
};

struct alignas(64) LightFork {
  LightNode side[2];
};

/// How far the lights of each side of a fork reach from themselves at most.
struct LightRanges {
  float side[2];
};

class LightTree {
 public:
  LightTree() = default;  ///< of no lights
  /// `forks[i]` parts the leaves, in their order from left to right, after leaf i: fork i is the one whose left side
  /// ends there. `leaf_of[light]`: its place in that order, kNoIndex: not in the tree.
  /// `ranges`: of the forks; empty where no light has one.
  LightTree(uint32_t root, std::vector<LightFork> forks, std::vector<uint32_t> leaf_of,
            std::vector<LightRanges> ranges);

  bool empty() const { return root_ == kNone; }

  struct Choice {
    uint32_t light = 0;
    double chance = 0;     ///< 0: no light reaches the place
    double remainder = 0;  ///< where the number drawn fell inside the choice, in [0, 1)
  };
  /// Requires: !empty(), u in [0, 1).
  Choice sample(const LightReceiver& receiver, double u) const;
  /// The chance with which sample() finds this light. Requires: light < the number that the tree was made for.
  double chance(const LightReceiver& receiver, uint32_t light) const;

  uint64_t resident_bytes() const {
    return forks_.capacity() * sizeof(LightFork) + leaf_of_.capacity() * sizeof(uint32_t) +
           ranges_.capacity() * sizeof(LightRanges);
  }

 private:
  static constexpr uint32_t kNone = 0xffffffffu;

  struct Weights {
    double side[2];
  };
  Weights weigh(const LightImportance& importance, uint32_t fork) const {
    const LightFork& f = forks_[fork];
    if (ranges_.empty()) return {{importance(f.side[0]), importance(f.side[1])}};
    const LightRanges& r = ranges_[fork];
    return {{importance(f.side[0], r.side[0]), importance(f.side[1], r.side[1])}};
  }

  uint32_t root_ = kNone;
  std::vector<LightFork> forks_;
  std::vector<uint32_t> leaf_of_;
  std::vector<LightRanges> ranges_;
};

}  // namespace shoal
