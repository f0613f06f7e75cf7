#include "engine/light_sums.h"

#include <algorithm>
#include <cmath>

#include "engine/light_bounds.h"
#include "engine/math.h"

namespace shoal {
namespace {

/// The cosine of the half angle of a cone, or of one with its opposite, in which directions spread evenly would have
/// the mean of these: with mean vector m, |m| = (1 + c) / 2; with both sides the mean of the squared cosine to their
/// main axis is (1 + c + c^2) / 3, and it is (1 + r) / 3 if the mean tensor T has the same spread in the other two
/// axes, with r^2 = 6 tr(T^2) - 2.
float spread_cosine(const LightSums& s) {
  const float scale = 1 / s.square[3];
  if (s.mixed[3] > 0) {
    const float q = s.square[0] * s.square[0] + s.square[1] * s.square[1] + s.square[2] * s.square[2] +
                    2 * (s.mixed[0] * s.mixed[0] + s.mixed[1] * s.mixed[1] + s.mixed[2] * s.mixed[2]);
    const float r = std::sqrt(std::max(6 * (q * scale * scale) - 2, 0.0f));
    return std::min(0.5f * (std::sqrt(1 + 4 * r) - 1), 1.0f);
  }
  const float m = std::sqrt(s.axis[0] * s.axis[0] + s.axis[1] * s.axis[1] + s.axis[2] * s.axis[2]) * scale;
  return std::clamp(2 * m - 1, -1.0f, 1.0f);
}

}  // namespace

double light_cost(const LightSums& s) {
  const double x = double{s.hi[0]} - s.lo[0], y = double{s.hi[1]} - s.lo[1], z = double{s.hi[2]} - s.lo[2];
  const double size = s.axis[3] * (x * x + y * y + z * z);
  if (s.hi[3] >= static_cast<float>(NormalCone::kEveryWay)) return size * (4 * kPi);
  const float cosine = spread_cosine(s);
  if (s.hi[3] == 0 && cosine >= 0 && s.lo[3] == -0.5f * kPi) {
    // emission_solid_angle() of a hemisphere: there w = o + pi / 2.
    return size * (kPi * (2 - cosine + 0.5f * kPi * std::sqrt(1 - cosine * cosine)));
  }
  return size * emission_solid_angle(cosine, s.hi[3], -s.lo[3]);
}

}  // namespace shoal
