#include "engine/position_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "treelets/triangle_refs.h"

namespace shoal {

namespace {

/// Of a grid's farthest point, in steps: one less than the bits of a float, as leaves have it (kMaxGridSteps).
constexpr int kMostBits = 23;

/// The least e with 2^e >= x > 0.
int power_above(double x) {
  int exponent;
  return std::frexp(x, &exponent) == 0.5 ? exponent - 1 : exponent;
}

}  // namespace

const char* position_precision_name(PositionPrecision precision) {
  switch (precision) {
    case PositionPrecision::k21:
      return "21";
    case PositionPrecision::k16:
      return "16";
    case PositionPrecision::kExact:
      break;
  }
  return "exact";
}

Result<PositionPrecision> parse_position_precision(const std::string& name) {
  for (const PositionPrecision precision : kPositionPrecisions) {
    if (name == position_precision_name(precision)) return precision;
  }
  return Error{ErrorCode::kUsage, fmt::format("precision of positions: expected exact, 21 or 16, found '{}'", name)};
}

PositionGrid PositionGrid::of(PositionPrecision precision, const Bounds3& bounds) {
  if (precision == PositionPrecision::kExact || bounds.empty()) return {};
  double extent = 0, largest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    extent = std::max(extent, static_cast<double>(bounds.hi[axis]) - bounds.lo[axis]);
    largest = std::max({largest, std::abs(static_cast<double>(bounds.lo[axis])), std::abs(static_cast<double>(bounds.hi[axis]))});
  }
  if (!(extent > 0)) return {};
  const int wanted = power_above(extent) - static_cast<int>(precision), finest = power_above(largest) - kMostBits;
  const int exponent = std::max(wanted, finest);
  const double step = std::ldexp(1.0, exponent);
  // What is too small for floats, or would be rounded to more than they hold, stays as it is.
  if (exponent < -126 || std::nearbyint(largest / step) * step > std::numeric_limits<float>::max()) return {};
  return {static_cast<float>(step), finest > wanted};
}

void PositionGrid::round(std::span<float> coordinates) const {
  if (step == 0) return;
  const float steps_a_unit = 1 / step;
  for (float& x : coordinates) x = std::nearbyint(x * steps_a_unit) * step + 0.0f;
}

float farthest_shift(float step, const Affine3& to_world) {
  double farthest = 0;
  for (const double y : {-0.5, 0.5}) {
    for (const double z : {-0.5, 0.5}) {  // opposite corners go equally far
      double squares = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const double moved = 0.5 * to_world.column_x[axis] + y * to_world.column_y[axis] + z * to_world.column_z[axis];
        squares += moved * moved;
      }
      farthest = std::max(farthest, std::sqrt(squares) * step);
    }
  }
  return farthest == 0 ? 0.0f : std::nextafter(static_cast<float>(farthest), std::numeric_limits<float>::infinity());
}

void include_corners(std::span<const float> positions, Bounds3& bounds) {
  for (size_t i = 0; i < positions.size(); i += 9) {
    const float* p = &positions[i];
    if (is_degenerate(p)) continue;
    for (int corner = 0; corner < 9; corner += 3) bounds.include(Vec3(p[corner], p[corner + 1], p[corner + 2]));
  }
}

}  // namespace shoal
