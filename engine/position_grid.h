// How exactly positions are stored, and the grid that they are rounded to where that is not exactly: whole multiples of
// one power of two, the same on every axis of an object. All vertices in one place go to one place, so that what was
// closed stays closed, whatever the treelets and chunks. Meshes that are baked into the world object share its grid;
// an instanced object has a grid in its own space.
// Called by engine/build_scene and engine/build_chunks. Pure. Cost: about 1 ns a coordinate.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "io/result.h"
#include "treelets/vector.h"

namespace shoal {

/// The value is the number of bits; 0: the floats as they are.
enum class PositionPrecision : uint32_t { kExact = 0, k16 = 16, k21 = 21 };
inline constexpr PositionPrecision kPositionPrecisions[] = {PositionPrecision::kExact, PositionPrecision::k21,
                                                            PositionPrecision::k16};

/// "exact", "21", "16".
const char* position_precision_name(PositionPrecision precision);
/// Fails with: kUsage.
Result<PositionPrecision> parse_position_precision(const std::string& name);

struct PositionGrid {
  float step = 0;        ///< a power of two; 0: positions stay as they are
  bool far_out = false;  ///< the second rule of of() set it

  /// The finest step for which the longest side of `bounds` has at most 2^16 or 2^21 steps and every coordinate in it is
  /// at most 2^23 steps from zero, so that each point of the grid is a float, and a leaf can hold it. Far from the origin
  /// (more than some 4 times the extent for 21 bits, 128 times for 16) it is the second rule that sets the step: two
  /// units in the last place of the largest coordinate. Exact where that would take steps below 2^-126.
  static PositionGrid of(PositionPrecision precision, const Bounds3& bounds);

  /// Each coordinate to the nearest point, halves to the even one, no zero with a sign. A coordinate is moved by half
  /// a step at most.
  void round(std::span<float> coordinates) const;
};

/// How far, at most, rounding to steps of `step` moves a point that is then placed by `to_world`: the image of the corner
/// of the cube of half a step about it that goes farthest. Rounded up.
float farthest_shift(float step, const Affine3& to_world);

/// Adds the corners of the triangles that a build stores (nine floats each).
void include_corners(std::span<const float> positions, Bounds3& bounds);

}  // namespace shoal
