#include "engine/texture_footprint.h"

#include <bit>
#include <cmath>

namespace shoal {
namespace {

using DVec2 = glm::dvec2;
using DVec3 = glm::dvec3;

/// A texel of the level is at least this share of the footprint's longer axis.
constexpr double kLeastAxisRatio = 1.0 / 8;
/// Below this cosine a surface is seen from the side, and its footprint is that of this cosine.
constexpr double kLeastCosine = 1.0 / 64;

}  // namespace

TextureFootprint::TextureFootprint(const Surface& surface, float width, float choice)
    : surface_(surface), choice_(choice) {
  const DVec3 e1 = surface.edge1, e2 = surface.edge2, n = glm::cross(e1, e2);
  const double n2 = glm::dot(n, n);
  if (!(n2 > 0) || !std::isfinite(n2) || !(width > 0)) return;
  const DVec3 normal = surface.geometric_normal, wo = surface.wo;
  const DVec3 side = glm::cross(normal, wo);
  const double cosine = std::max(glm::dot(normal, wo), kLeastCosine), sine = std::sqrt(glm::dot(side, side));
  // The shorter axis lies across the ray. Seen from straight above any pair will do.
  const DVec3 across = sine > 1e-6 ? side / sine : e1 / std::sqrt(glm::dot(e1, e1));
  const DVec3 along = glm::cross(normal, across);
  const auto barycentric = [&](const DVec3& v) {
    return DVec2(glm::dot(glm::cross(v, e2), n), glm::dot(glm::cross(e1, v), n)) / n2;
  };
  across_ = barycentric(across) * double{width};
  along_ = barycentric(along) * (double{width} / cosine);
}

uint32_t TextureFootprint::level(const Texture& texture, uint32_t uv_set, const float* m) const {
  if (uv_set >= 4 || texture.level_count <= 1) return 0;
  const CornerAttributes* c = surface_.attributes.corner;
  const DVec2 d1 = DVec2(c[1].uv[uv_set]) - DVec2(c[0].uv[uv_set]);
  const DVec2 d2 = DVec2(c[2].uv[uv_set]) - DVec2(c[0].uv[uv_set]);
  const auto texels2 = [&](const DVec2& axis) {
    DVec2 uv = d1 * axis.x + d2 * axis.y;
    if (m != nullptr) uv = {double{m[0]} * uv.x + double{m[1]} * uv.y, double{m[3]} * uv.x + double{m[4]} * uv.y};
    uv *= DVec2(texture.width, texture.height);
    return glm::dot(uv, uv);
  };
  const double a = texels2(across_), b = texels2(along_);
  const auto size2 = static_cast<float>(std::max(std::min(a, b), std::max(a, b) * (kLeastAxisRatio * kLeastAxisRatio)));
  if (!(size2 > 1)) return 0;
  const float last = static_cast<float>(texture.level_count - 1);
  return static_cast<uint32_t>(std::min(0.5f * rough_log2(size2) + choice_, last));
}

float rough_log2(float v) {
  const uint32_t bits = std::bit_cast<uint32_t>(v);
  return static_cast<float>(static_cast<int32_t>(bits) - 0x3f800000) * 0x1p-23f;
}

}  // namespace shoal
