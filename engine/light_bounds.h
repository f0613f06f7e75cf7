// What is known of a set of lights while a tree over them is built: where they are, which ways they face, how strong
// they are (Conty Estevez & Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting", sections 4
// and 5). Angles come from engine/math, so the same lights give the same bits everywhere. Called by
// engine/build_light_tree and engine/light_sums. Pure; a union costs 5 ns when nothing widens, else about 100 ns.
#pragma once

#include "treelets/vector.h"

namespace shoal {

/// The axes of lights lie within `angle` of `axis`; of lights with `both_sides`, their axes or the opposites do.
struct NormalCone {
  glm::dvec3 axis{0, 0, 1};
  double angle = 0;       ///< radians; kEveryWay: no axis is left out
  double cos_angle = 1;
  bool both_sides = false;

  static constexpr double kEveryWay = 3.2;  ///< anything above pi
  static NormalCone every_way() { return {{0, 0, 1}, kEveryWay, -1, false}; }
};

struct LightBounds {
  Bounds3 box;
  NormalCone cone;
  double emission_angle = 0;  ///< a light sends nothing further than this from its axis
  double strength = 0;        ///< sum of intensities along the axes; 0: no light yet
  float range = 0;            ///< the largest: of a light without one, infinity

  void add(const LightBounds& other);
};

NormalCone cone_union(const NormalCone& a, const NormalCone& b);

/// The solid angle that lights of a cone send to, each way weighed by its cosine to the nearest axis (M_Omega, eq. 1 of
/// the paper). `cosine`: of the cone's angle, which is `wider` still by that much; beyond its
/// axis, a light sends up to `emission_angle`.
double emission_solid_angle(double cosine, double wider, double emission_angle);

}  // namespace shoal
