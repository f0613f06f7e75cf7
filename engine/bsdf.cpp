#include "engine/bsdf.h"

namespace shoal {
namespace {

constexpr float kInversePi = 0.31830988618379067f;

/// Set by tests/engine/principled_reference_test.cpp alone, for the formulas of the pictures it compares with: diffuse
/// light that gloss takes nothing from, with the retro-reflection of Burley 2015 ("Extending the Disney BRDF to a BSDF
/// with Integrated Subsurface Scattering", section 2.1, the factors of 2012), and gloss that keeps no energy.
#ifdef SHOAL_PRINCIPLED
constexpr bool kPrincipled = true;
#else
constexpr bool kPrincipled = false;
#endif

/// Burley 2012, "Physically-Based Shading at Disney", section 5.3: over base colour / pi.
float retro_reflection(float roughness, float cosine_d, float cosine_i, float cosine_o) {
  const float grazing = 2 * roughness * cosine_d * cosine_d - 0.5f;
  return (1 + grazing * power5(1 - cosine_i)) * (1 + grazing * power5(1 - cosine_o));
}

}  // namespace

Bsdf::Bsdf(const MaterialSample& material, const EnergyTable* table, const Vec3& geometric_normal,
           const Vec3& shading_normal, const Vec3& wo)
    : frame_(shading_normal), geometric_normal_(geometric_normal), wo_(frame_.to_local(wo)) {
  if (!(wo_.z > kLeastViewCosine)) return;
  diffuse_ = material.base_color * (1 - material.metallic);
  const bool specular = table != nullptr && material.has_specular_lobe();
  const float specular_albedo = specular ? set_specular(material, *table) : 0.0f;
  const float diffuse_albedo = luminance(diffuse_), sum = diffuse_albedo + specular_albedo;
  if (!(sum > 0)) return;
  // Lobes are chosen by what they reflect; the last probability is the rest, so that the two sum to one.
  specular_probability_ = specular_albedo / sum;
  diffuse_probability_ = 1 - specular_probability_;
}

float Bsdf::set_specular(const MaterialSample& material, const EnergyTable& table) {
  const float m = material.metallic;
  ggx_.alpha = std::clamp(material.roughness * material.roughness, kMinAlpha, 1.0f);
  lambda_o_ = ggx_.lambda(wo_);

  const SpecularAlbedo e = table.albedo(std::min(wo_.z, 1.0f), ggx_.alpha);
  const float lost = kPrincipled ? 0.0f : std::max(0.0f, 1 - e.total()) / e.total();
  const Vec3 f0_dielectric =
      glm::min(material.dielectric_f0 * material.specular_color, Vec3(1)) * material.specular;
  const Vec3 gain_dielectric = 1.0f + f0_dielectric * lost, gain_metal = 1.0f + material.base_color * lost;
  f0_ = (1 - m) * f0_dielectric * gain_dielectric + m * material.base_color * gain_metal;
  f90_ = (1 - m) * material.specular * gain_dielectric + m * gain_metal;

  const Vec3 dielectric_albedo = (f0_dielectric * e.a + Vec3(material.specular * e.b)) * gain_dielectric;
  if (!kPrincipled) diffuse_ *= std::max(0.0f, 1 - max_component(dielectric_albedo));
  return luminance(f0_ * e.a + f90_ * e.b);
}

BsdfValue Bsdf::evaluate_local(const Vec3& wi) const {
  BsdfValue result;
  result.value = diffuse_ * (kInversePi * wi.z);
  result.pdf = diffuse_probability_ * (kInversePi * wi.z);
  if (specular_probability_ == 0) return result;
  const Vec3 h = glm::normalize(wo_ + wi);
  const float cosine = std::clamp(glm::dot(wo_, h), 0.0f, 1.0f);
  if (kPrincipled) result.value *= retro_reflection(std::sqrt(ggx_.alpha), cosine, wi.z, wo_.z);
  const float d = ggx_.d(h) / (4 * wo_.z);
  result.value += (f0_ + (f90_ - f0_) * power5(1 - cosine)) * (d / (1 + lambda_o_ + ggx_.lambda(wi)));
  result.pdf += specular_probability_ * (d / (1 + lambda_o_));
  return result;
}

BsdfValue Bsdf::evaluate(const Vec3& wi) const {
  if (black() || !(glm::dot(geometric_normal_, wi) > 0)) return {};
  const Vec3 local = frame_.to_local(wi);
  return local.z > 0 ? evaluate_local(local) : BsdfValue{};
}

BsdfSample Bsdf::sample(float u_lobe, float u1, float u2) const {
  if (black()) return {};
  Vec3 wi;
  RayBirth birth = RayBirth::kDiffuse;
  if (u_lobe < specular_probability_) {
    birth = birth_of_reflection(ggx_.alpha);
    const Vec3 h = ggx_.sample_visible_normal(wo_, u1, u2);
    wi = glm::normalize(2 * glm::dot(wo_, h) * h - wo_);
  } else {
    wi = sample_cosine_hemisphere(u1, u2);
  }
  if (!(wi.z > 0)) return {};
  const Vec3 world = frame_.to_world(wi);
  if (!(glm::dot(geometric_normal_, world) > 0)) return {};
  const BsdfValue value = evaluate_local(wi);
  // An overflow here (grazing by the last ulp) is no direction either, but it is counted.
  if (!std::isfinite(value.pdf)) return {.finite = false};
  if (!(value.pdf > 0)) return {};
  return {world, value.value / value.pdf, value.pdf, true, birth};
}

}  // namespace shoal
