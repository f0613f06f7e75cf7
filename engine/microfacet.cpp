#include "engine/microfacet.h"

#include "engine/math.h"

namespace shoal {

Vec3 Ggx::sample_visible_normal(const Vec3& wo, float u1, float u2) const {
  return GgxAnisotropic{alpha, alpha}.sample_visible_normal(wo, u1, u2);
}

Vec3 GgxAnisotropic::sample_visible_normal(const Vec3& wo, float u1, float u2) const {
  const Vec3 stretched = glm::normalize(Vec3(wo.x * alpha_x, wo.y * alpha_y, wo.z));
  const SinCos phi = sin_cos(2 * kPi * u1);
  const float z = (1 - u2) * (1 + stretched.z) - stretched.z;  // uniform on the cap seen by `stretched`
  const float sine = std::sqrt(std::max(0.0f, (1 - z) * (1 + z)));
  const Vec3 h = Vec3(sine * phi.cos, sine * phi.sin, z) + stretched;
  return glm::normalize(Vec3(h.x * alpha_x, h.y * alpha_y, std::max(h.z, 0.0f)));
}

}  // namespace shoal
