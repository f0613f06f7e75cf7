// A surface that scatters like Lambert's: what engine/bsdf.h is for metallic 0 and specular 0, to the bit, without what
// that has no use for. Called by engine/shade for materials with kMaterialLambert. Pure; on the stack.
#pragma once

#include "engine/bsdf.h"

namespace shoal {

class LambertBsdf {
 public:
  static constexpr bool kTransmits = false;
  static constexpr bool transmits() { return false; }

  /// As for Bsdf.
  LambertBsdf(const Vec3& color, const Vec3& geometric_normal, const Vec3& shading_normal, const Vec3& wo)
      : frame_(shading_normal),
        geometric_normal_(geometric_normal),
        color_(color),
        black_(!(frame_.to_local(wo).z > kLeastViewCosine) || !(luminance(color) > 0)) {}

  bool black() const { return black_; }
  BsdfValue evaluate(const Vec3& wi) const {
    if (black_ || !(glm::dot(geometric_normal_, wi) > 0)) return {};
    const float cosine = frame_.to_local(wi).z;
    return cosine > 0 ? towards(cosine) : BsdfValue{};
  }
  BsdfSample sample(float /*u_lobe*/, float u1, float u2) const {
    const Vec3 wi = sample_cosine_hemisphere(u1, u2);
    if (black_ || !(wi.z > 0)) return {};
    const Vec3 world = frame_.to_world(wi);
    if (!(glm::dot(geometric_normal_, world) > 0)) return {};
    const BsdfValue value = towards(wi.z);
    if (!(value.pdf > 0)) return {};
    return {world, value.value / value.pdf, value.pdf};
  }

 private:
  BsdfValue towards(float cosine) const {
    constexpr float kInversePi = 0.31830988618379067f;
    return {color_ * (kInversePi * cosine), kInversePi * cosine};
  }

  Frame frame_;
  Vec3 geometric_normal_;
  Vec3 color_;
  bool black_;
};

}  // namespace shoal
