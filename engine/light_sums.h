// Sums over lights from which the cost of having them in one node of a light tree is estimated. The box and the
// strength are exact; the cone is guessed from the moments of the axes: what is chosen by it is the shape of the tree,
// and whatever that is the bounds of the tree hold. Called by engine/cluster_lights and engine/split_lights. Pure; an
// addition costs 3 ns, a cost 10 ns.
#pragma once

#include "engine/build_light_tree.h"

namespace shoal {

/// In fours, for vector registers.
struct LightSums {
  float lo[4];      ///< of the box; [3]: minus the largest emission angle
  float hi[4];      ///< [3]: the largest angle of a cone
  float axis[4];    ///< sum of axes; [3]: of strengths
  float square[4];  ///< sums of x x, y y, z z of axes; [3]: how many lights
  float mixed[4];   ///< sums of x y, x z, y z; [3]: how many have both sides

  LightSums() = default;  ///< to be assigned to
  explicit LightSums(const TreeLight& light) {
    for (int c = 0; c < 3; ++c) {
      lo[c] = light.lo[c], hi[c] = light.hi[c];
      axis[c] = light.axis[c], square[c] = light.axis[c] * light.axis[c];
    }
    lo[3] = -light.emission_angle, hi[3] = light.angle, axis[3] = light.strength, square[3] = 1;
    mixed[0] = axis[0] * axis[1], mixed[1] = axis[0] * axis[2], mixed[2] = axis[1] * axis[2];
    mixed[3] = light.both_sides != 0 ? 1.0f : 0.0f;
  }

  void add(const LightSums& o) {
    for (int c = 0; c < 4; ++c) lo[c] = lo[c] < o.lo[c] ? lo[c] : o.lo[c];
    for (int c = 0; c < 4; ++c) hi[c] = hi[c] > o.hi[c] ? hi[c] : o.hi[c];
    for (int c = 0; c < 4; ++c) axis[c] += o.axis[c];
    for (int c = 0; c < 4; ++c) square[c] += o.square[c];
    for (int c = 0; c < 4; ++c) mixed[c] += o.mixed[c];
  }
};

/// Strength * solid angle of emission * squared diagonal of the box. The diagonal stands for the surface area of the
/// paper (engine/light_bounds) because sampling sees a set of lights as the sphere around its box.
double light_cost(const LightSums& sums);

}  // namespace shoal
