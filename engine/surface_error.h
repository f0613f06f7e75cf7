// How far a computed point on a triangle may lie from the plane that traversal tests, and where a ray must start so
// that it cannot meet that triangle again. Error analysis of Pharr et al., Physically Based Rendering 4e, section
// 6.8. No epsilon: every term is a bound on rounding. Called by engine/surface and engine/light_sampler. Pure.
#pragma once

#include "treelets/top_tree.h"
#include "treelets/vector.h"

namespace shoal {

/// gamma(n) = n e / (1 - n e), e = 2^-24: bounds the relative error of n roundings (Higham; PBRT eq. 6.18).
inline constexpr float gamma_bound(int n) {
  return static_cast<float>(n) * 0x1p-24f / (1 - static_cast<float>(n) * 0x1p-24f);
}

/// A point with a bound on its error, an axis.
struct BoundedPoint {
  Vec3 point{0};
  Vec3 error{0};
};

/// p0 + b1 (p1 - p0) + b2 (p2 - p0): whatever b1 and b2 are, only rounding moves it off the triangle's plane.
BoundedPoint point_on_triangle(const Vec3& p0, const Vec3& p1, const Vec3& p2, float b1, float b2);

/// An object-space point in world space. The error includes the way back: a ray that starts there is rounded again
/// when traversal takes it into the object's space.
BoundedPoint to_world(const BoundedPoint& object_point, const Instance& instance);
/// For a world-space point that was not made by to_world(): the error of the way back, and of the way here.
Vec3 instance_error(const Vec3& world_point, const Instance& instance);

/// The far end of a ray from `origin` (t = 1): `target` with the error of the ray's own arithmetic added, which
/// rounds origin, direction and t by parts of their lengths, once more in the space of `instance` (null: a point of
/// no surface).
BoundedPoint ray_end(const BoundedPoint& target, const Vec3& origin, const Instance* instance);

/// Moves a point along `normal` past its error bounds and one representable number further (PBRT 6.8.6).
Vec3 offset_point(const BoundedPoint& p, const Vec3& normal);

/// How high above the true surface offset_point() may begin, along `normal`, at most. A ray from there meets every other
/// surface that lies farther above than this and that surface's own error; one closer may be passed over.
float offset_reach(const BoundedPoint& p, const Vec3& normal);

}  // namespace shoal
