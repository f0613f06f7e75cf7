#include "engine/sheen.h"

#include <algorithm>
#include <cmath>

#include "engine/math.h"

namespace shoal {
namespace {

constexpr float kLog2E = 1.44269504088896340736f;

/// Estevez & Kulla 2017, eq. 3 with table 1: between the rows for alpha 0 and 1 by (1 - alpha)^2.
float fitted(float x, float alpha) {
  const float s = (1 - alpha) * (1 - alpha);
  const auto mix = [s](float rough, float smooth) { return rough + s * (smooth - rough); };
  const float a = mix(21.5473f, 25.3245f), b = mix(3.82987f, 3.32435f), c = mix(0.19823f, 0.16801f);
  const float d = mix(-1.97760f, -1.27393f), e = mix(-4.32054f, -4.85967f);
  return a / (1 + b * power_of(x, c)) + d * x + e;
}

}  // namespace

float Sheen::d(const Vec3& h) const {
  const float sine2 = h.x * h.x + h.y * h.y, inverse = 1 / alpha;
  return (2 + inverse) * power_of(sine2, 0.5f * inverse) * (0.5f / kPi);
}

float Sheen::lambda(float cosine) const {
  const float exponent =
      cosine < 0.5f ? fitted(cosine, alpha) : 2 * fitted(0.5f, alpha) - fitted(std::max(0.0f, 1 - cosine), alpha);
  return exp2_of(exponent * kLog2E);
}

float Sheen::value(const Vec3& wo, const Vec3& wi) const {
  const Vec3 sum = wo + wi;
  const float length2 = glm::dot(sum, sum);
  if (!(length2 > 0)) return 0;
  return d(sum / std::sqrt(length2)) / (4 * wo.z * (1 + lambda(std::min(wo.z, 1.0f)) + lambda(std::min(wi.z, 1.0f))));
}

}  // namespace shoal
