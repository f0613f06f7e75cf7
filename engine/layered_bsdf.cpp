#include "engine/layered_bsdf.h"

#include "engine/thin_film.h"

namespace shoal {
namespace {

constexpr float kInversePi = 0.31830988618379067f;
constexpr float kCoatF0 = 0.04f;  ///< KHR_materials_clearcoat: an index of 1.5

float to_alpha(float roughness) { return std::clamp(roughness * roughness, kMinAlpha, 1.0f); }

/// (D, Lambda) of reflection by a half vector, as in Bsdf: value F d / (1 + Lo + Li), density d / (1 + Lo).
template <class Distribution>
float reflection_density(const Distribution& ggx, const Vec3& h, const Vec3& wo) {
  return ggx.d(h) / (4 * wo.z);
}

}  // namespace

LayeredBsdf::LayeredBsdf(const LayeredSample& m, const LobeTables& tables, const Vec3& geometric_normal,
                         const Vec3& shading_normal, const Vec3& wo)
    : frame_(shading_normal),
      coat_frame_(shading_normal),
      geometric_normal_(geometric_normal),
      outside_(m.outside),
      disperses_(m.disperses),
      wavelength_weight_(m.wavelength_weight) {
  set_frame(m, wo);
  if (!(wo_.z > kLeastViewCosine)) return;
  diffuse_ = m.base_color * (1 - m.metallic);
  float rest = 1;
  if (tables.energy != nullptr && m.has_specular_lobe()) rest = set_specular(m, tables);
  set_inner(m, tables, rest);
  set_coats(m, tables, wo);
  choose_probabilities();
}

void LayeredBsdf::set_frame(const LayeredSample& m, const Vec3& wo) {
  if (m.anisotropy > 0) {
    const Vec3 along = m.anisotropy_direction - frame_.z * glm::dot(frame_.z, m.anisotropy_direction);
    const float length2 = glm::dot(along, along);
    if (length2 > 1e-12f) {
      frame_.x = along / std::sqrt(length2);
      frame_.y = glm::cross(frame_.z, frame_.x);
      anisotropic_ = true;
    }
  }
  wo_ = frame_.to_local(wo);
}

Vec3 LayeredBsdf::film_f0(const LayeredSample& m, const Vec3& f0, float f90) const {
  if (!(m.iridescence > 0) || !(f90 > 0)) return f0;
  // The film's reflectance where the view meets the surface, as the F0 of the Schlick term that has it there: exact
  // for smooth surfaces, and the albedo tables stay valid.
  const float cosine = std::min(wo_.z, 1.0f), schlick = power5(1 - cosine);
  const Vec3 film = thin_film_reflectance(cosine, m.film_ior, m.film_thickness, glm::min(f0 / f90, 1.0f));
  const Vec3 at_normal = glm::clamp((film - schlick) / std::max(1 - schlick, 1e-4f), 0.0f, 1.0f) * f90;
  return f0 + m.iridescence * (at_normal - f0);
}

float LayeredBsdf::set_specular(const LayeredSample& material, const LobeTables& tables) {
  const float m = material.metallic;
  ggx_.alpha = to_alpha(material.roughness);
  if (anisotropic_) stretched_ = anisotropic_ggx(ggx_.alpha, material.anisotropy);
  lambda_o_ = anisotropic_ ? stretched_.lambda(wo_) : ggx_.lambda(wo_);

  const SpecularAlbedo e = anisotropic_ ? tables.anisotropy->albedo(wo_, stretched_)
                                        : tables.energy->albedo(std::min(wo_.z, 1.0f), ggx_.alpha);
  const float lost = std::max(0.0f, 1 - e.total()) / e.total();
  const Vec3 f0_dielectric = film_f0(
      material, glm::min(material.dielectric_f0 * material.specular_color, Vec3(1)) * material.specular,
      material.specular);
  const Vec3 f0_metal = film_f0(material, material.base_color, 1);
  const Vec3 gain_dielectric = 1.0f + f0_dielectric * lost, gain_metal = 1.0f + f0_metal * lost;
  const bool glass = material.volume && material.transmission > 0 && bends_light(material.ior);
  const float dielectric = glass ? (1 - m) * (1 - material.transmission) : 1 - m;
  f0_ = dielectric * f0_dielectric * gain_dielectric + m * f0_metal * gain_metal;
  f90_ = dielectric * material.specular * gain_dielectric + m * gain_metal;
  if (glass) set_glass(material, tables, f0_dielectric, material.specular);

  const Vec3 dielectric_albedo = (f0_dielectric * e.a + Vec3(material.specular * e.b)) * gain_dielectric;
  albedo_[kSpecular] = luminance(f0_ * e.a + f90_ * e.b);
  return std::max(0.0f, 1 - max_component(dielectric_albedo));
}

void LayeredBsdf::set_glass(const LayeredSample& m, const LobeTables& tables, const Vec3& f0, float f90) {
  ggx_.alpha = to_alpha(m.roughness);
  eta_ = m.outside ? m.ior : 1 / m.ior;
  glass_f0_ = f0, glass_f90_ = f90;
  glass_lambda_o_ = ggx_.lambda(wo_);
  const GlassAlbedo e = tables.glass->albedo(std::min(wo_.z, 1.0f), ggx_.alpha, eta_);
  const float f0_most = max_component(f0), sent = e.sum(f0_most, f90), weight = (1 - m.metallic) * m.transmission;
  glass_weight_ = weight / std::max(sent, 0.05f);
  glass_tint_ = m.base_color;
  const Vec3 reflected = f0 * e.a + Vec3(f90 * e.b + e.total);
  const float transmitted = (1 - f0_most) * e.c + (1 - f90) * e.d;
  albedo_[kGlass] = glass_weight_ * luminance(reflected + glass_tint_ * transmitted);
}

void LayeredBsdf::set_inner(const LayeredSample& m, const LobeTables& tables, float rest) {
  const bool glass = m.volume && bends_light(m.ior);
  const float passes = m.transmission, dielectric = 1 - m.metallic;
  if (passes > 0) {
    if (glass && glass_weight_ == 0) set_glass(m, tables, Vec3(0), 0);  // no specular lobe: everything goes through
    if (!glass) {
      // The less the index, the less a rough thin wall blurs, down to nothing at 1 (KHR_materials_transmission asks
      // for the dependence; the form is that of the Khronos sample renderer, 1 from 1.5 on).
      thin_ggx_.alpha = to_alpha(m.roughness * std::clamp(2 * m.ior - 2, 0.0f, 1.0f));
      thin_lambda_o_ = thin_ggx_.lambda(wo_);
      const float e = tables.energy->albedo(std::min(wo_.z, 1.0f), thin_ggx_.alpha).total();
      const Vec3 albedo = m.base_color * (dielectric * passes * rest);
      thin_ = albedo / e;
      albedo_[kThin] = luminance(albedo);
    }
    diffuse_ *= 1 - passes;
  }
  if (m.diffuse_transmission > 0) {
    diffuse_below_ =
        m.diffuse_transmission_color * (dielectric * (1 - passes) * m.diffuse_transmission * rest);
    diffuse_ *= 1 - m.diffuse_transmission;
    albedo_[kDiffuseBelow] = luminance(diffuse_below_);
  }
  diffuse_ *= rest;
  albedo_[kDiffuse] = luminance(diffuse_);
}

/// Coat and sheen lie on the front; from inside a volume they are not met.
void LayeredBsdf::set_coats(const LayeredSample& m, const LobeTables& tables, const Vec3& wo) {
  if (m.volume && !m.outside) return;
  float below = 1, below_coat = 1;
  if (m.clearcoat > 0) {
    coat_frame_ = Frame(m.clearcoat_normal);
    coat_wo_ = coat_frame_.to_local(wo);
    if (coat_wo_.z > kLeastViewCosine) {
      coat_ggx_.alpha = to_alpha(m.clearcoat_roughness);
      coat_lambda_o_ = coat_ggx_.lambda(coat_wo_);
      const SpecularAlbedo e = tables.energy->albedo(std::min(coat_wo_.z, 1.0f), coat_ggx_.alpha);
      const float gain = 1 + kCoatF0 * std::max(0.0f, 1 - e.total()) / e.total();
      coat_f0_ = m.clearcoat * kCoatF0 * gain, coat_f90_ = m.clearcoat * gain;
      albedo_[kCoat] = coat_f0_ * e.a + coat_f90_ * e.b;
      below_coat = std::max(0.0f, 1 - albedo_[kCoat]);
    }
  }
  if (m.sheen_color != Vec3(0)) {
    fibres_.alpha = std::clamp(m.sheen_roughness * m.sheen_roughness, kMinSheenAlpha, 1.0f);
    const float e = tables.sheen->albedo(std::min(wo_.z, 1.0f), fibres_.alpha);
    sheen_ = m.sheen_color * (below_coat / std::max(1.0f, e));
    albedo_[kSheenLobe] = luminance(sheen_) * e;
    below = 1 - max_component(m.sheen_color) * std::min(1.0f, e);
  }
  below *= below_coat;
  if (below == 1) return;
  for (Vec3* v : {&f0_, &f90_, &diffuse_, &diffuse_below_, &thin_}) *v *= below;
  glass_weight_ *= below;
  for (const Lobe lobe : {kSpecular, kDiffuse, kDiffuseBelow, kThin, kGlass}) albedo_[lobe] *= below;
}

void LayeredBsdf::choose_probabilities() {
  // Lobes are chosen by what they send out; the diffuse one has the rest, so that all sum to one. The two lobes that
  // every material has come first, as in Bsdf.
  float sum = albedo_[kDiffuse] + albedo_[kSpecular];
  for (int lobe = kCoat; lobe < kLobeCount; ++lobe) sum += albedo_[lobe];
  if (!(sum > 0)) return;
  black_ = false;
  float others = 0;
  for (int lobe = kCoat; lobe < kLobeCount; ++lobe) others += probability_[lobe] = albedo_[lobe] / sum;
  probability_[kSpecular] = albedo_[kSpecular] / sum;
  const bool diffuse = albedo_[kDiffuse] > 0 || others == 0;
  probability_[kDiffuse] = diffuse ? std::max(0.0f, 1 - (probability_[kSpecular] + others)) : 0.0f;
}

void LayeredBsdf::add_specular(const Vec3& wi, BsdfValue& sum) const {
  const Vec3 h = glm::normalize(wo_ + wi);
  const float cosine = std::clamp(glm::dot(wo_, h), 0.0f, 1.0f);
  const float d = anisotropic_ ? reflection_density(stretched_, h, wo_) : reflection_density(ggx_, h, wo_);
  const float lambda_i = anisotropic_ ? stretched_.lambda(wi) : ggx_.lambda(wi);
  sum.value += (f0_ + (f90_ - f0_) * power5(1 - cosine)) * (d / (1 + lambda_o_ + lambda_i));
  sum.pdf += probability_[kSpecular] * (d / (1 + lambda_o_));
}

void LayeredBsdf::add_coat(const Vec3& world_wi, BsdfValue& sum) const {
  const Vec3 wi = coat_frame_.to_local(world_wi);
  if (!(wi.z > 0)) return;
  const Vec3 h = glm::normalize(coat_wo_ + wi);
  const float cosine = std::clamp(glm::dot(coat_wo_, h), 0.0f, 1.0f);
  const float d = reflection_density(coat_ggx_, h, coat_wo_);
  sum.value += (coat_f0_ + (coat_f90_ - coat_f0_) * power5(1 - cosine)) *
               (d / (1 + coat_lambda_o_ + coat_ggx_.lambda(wi)));
  sum.pdf += probability_[kCoat] * (d / (1 + coat_lambda_o_));
}

void LayeredBsdf::add_sheen(const Vec3& wi, BsdfValue& sum) const {
  sum.value += sheen_ * fibres_.value(wo_, wi);
  sum.pdf += probability_[kSheenLobe] * (0.25f * kInversePi / std::sqrt(wi.z));
}

void LayeredBsdf::add_thin(const Vec3& wi, BsdfValue& sum) const {
  const Vec3 mirrored(wi.x, wi.y, -wi.z);
  const Vec3 h = glm::normalize(wo_ + mirrored);
  const float d = reflection_density(thin_ggx_, h, wo_);
  sum.value += thin_ * (d / (1 + thin_lambda_o_ + thin_ggx_.lambda(mirrored)));
  sum.pdf += probability_[kThin] * (d / (1 + thin_lambda_o_));
}

LayeredBsdf::GlassSplit LayeredBsdf::split_glass(float cosine) const {
  GlassSplit split;
  split.reflected = glass_f0_ + (glass_f90_ - glass_f0_) * power5(std::clamp(1 - cosine, 0.0f, 1.0f));
  split.transmitted = std::max(0.0f, 1 - max_component(split.reflected));
  const float up = luminance(split.reflected), down = luminance(glass_tint_) * split.transmitted;
  split.chance = up + down > 0 ? up / (up + down) : 1.0f;
  return split;
}

void LayeredBsdf::add_glass_reflection(const Vec3& wi, BsdfValue& sum) const {
  const Vec3 h = glm::normalize(wo_ + wi);
  const float cosine = std::clamp(glm::dot(wo_, h), 0.0f, 1.0f);
  float cos_t = 0;
  Vec3 refracted;
  const bool splits = refract(wo_, h, eta_, cos_t, refracted);
  GlassSplit split{Vec3(1), 0, 1};
  if (splits) split = split_glass(eta_ < 1 ? cos_t : cosine);
  const float d = reflection_density(ggx_, h, wo_);
  sum.value += split.reflected * (glass_weight_ * d / (1 + glass_lambda_o_ + ggx_.lambda(wi)));
  sum.pdf += probability_[kGlass] * split.chance * (d / (1 + glass_lambda_o_));
}

void LayeredBsdf::add_glass_refraction(const Vec3& wi, BsdfValue& sum) const {
  Vec3 h = wo_ + eta_ * wi;  // Walter et al. 2007, eq. 16
  const float length2 = glm::dot(h, h);
  if (!(length2 > 0)) return;
  h *= (h.z < 0 ? -1.0f : 1.0f) / std::sqrt(length2);
  const float oh = glm::dot(wo_, h), ih = glm::dot(wi, h);
  if (!(oh > 0) || !(ih < 0)) return;
  const GlassSplit split = split_glass(eta_ < 1 ? -ih : oh);
  const float denominator = oh + eta_ * ih;
  const float jacobian = eta_ * eta_ * -ih / (denominator * denominator);  // eq. 17
  const float d = ggx_.d(h) * oh / wo_.z * jacobian;
  sum.value += glass_tint_ * (split.transmitted * glass_weight_ * d /
                              ((1 + glass_lambda_o_) * (1 + ggx_.lambda(wi))));  // separable, as eq. 23 asks
  sum.pdf += probability_[kGlass] * (1 - split.chance) * (d / (1 + glass_lambda_o_));
}

BsdfValue LayeredBsdf::evaluate_world(const Vec3& world_wi, const Vec3& wi) const {
  BsdfValue sum;
  const float side = glm::dot(geometric_normal_, world_wi);
  if (side > 0) {
    if (wi.z > 0) {
      sum.value = diffuse_ * (kInversePi * wi.z);
      sum.pdf = probability_[kDiffuse] * (kInversePi * wi.z);
      if (probability_[kSpecular] > 0) add_specular(wi, sum);
      if (probability_[kSheenLobe] > 0) add_sheen(wi, sum);
      if (probability_[kGlass] > 0) add_glass_reflection(wi, sum);
    }
    if (probability_[kCoat] > 0) add_coat(world_wi, sum);
  } else if (side < 0 && wi.z < 0) {
    if (probability_[kDiffuseBelow] > 0) {
      sum.value += diffuse_below_ * (kInversePi * -wi.z);
      sum.pdf += probability_[kDiffuseBelow] * (kInversePi * -wi.z);
    }
    if (probability_[kThin] > 0) add_thin(wi, sum);
    if (probability_[kGlass] > 0) add_glass_refraction(wi, sum);
  }
  if (disperses_ && of_one_wavelength(world_wi)) sum.value *= wavelength_weight_;
  return sum;
}

BsdfValue LayeredBsdf::evaluate(const Vec3& wi) const {
  if (black_) return {};
  return evaluate_world(wi, frame_.to_local(wi));
}

Vec3 LayeredBsdf::sample_glass(float u_choice, float u1, float u2) const {
  const Vec3 h = ggx_.sample_visible_normal(wo_, u1, u2);
  const float cosine = glm::dot(wo_, h);
  float cos_t = 0;
  Vec3 refracted;
  if (refract(wo_, h, eta_, cos_t, refracted) && u_choice >= split_glass(eta_ < 1 ? cos_t : cosine).chance) {
    return refracted.z < 0 ? glm::normalize(refracted) : Vec3(0);
  }
  const Vec3 reflected = glm::normalize(2 * cosine * h - wo_);
  return reflected.z > 0 ? reflected : Vec3(0);
}

LayeredBsdf::Direction LayeredBsdf::sample_lobe(float u_lobe, float u1, float u2) const {
  const auto reflect = [](const Vec3& wo, const Vec3& h) { return glm::normalize(2 * glm::dot(wo, h) * h - wo); };
  // Where the drawing lobe does not count (evaluate_world), another that does must not answer for it.
  const auto on_side = [&](const Vec3& wi, bool there, RayBirth birth = RayBirth::kDiffuse) {
    const Vec3 world = frame_.to_world(wi);
    const float side = glm::dot(geometric_normal_, world);
    return there && (wi.z < 0 ? side < 0 : side > 0) ? Direction{wi, world, birth} : Direction{};
  };
  if (u_lobe < probability_[kSpecular]) {
    const Vec3 wi = reflect(wo_, anisotropic_ ? stretched_.sample_visible_normal(wo_, u1, u2)
                                              : ggx_.sample_visible_normal(wo_, u1, u2));
    return on_side(wi, wi.z > 0, birth_of_reflection(anisotropic_ ? stretched_.alpha_x : ggx_.alpha));
  }
  float u = u_lobe - probability_[kSpecular];
  int lobe = kCoat;
  for (; lobe < kLobeCount && !(u < probability_[lobe]); ++lobe) u -= probability_[lobe];
  // Rounding may leave the last numbers without a lobe: then the last one there is, if none is diffuse.
  if (lobe == kLobeCount && probability_[kDiffuse] == 0) {
    for (lobe = kGlass; lobe > kCoat && probability_[lobe] == 0;) --lobe;
    u = 0;
  }
  switch (lobe) {
    case kCoat: {
      const Vec3 wi = reflect(coat_wo_, coat_ggx_.sample_visible_normal(coat_wo_, u1, u2));
      const Vec3 world = coat_frame_.to_world(wi);
      const bool there = wi.z > 0 && glm::dot(geometric_normal_, world) > 0;
      return there ? Direction{frame_.to_local(world), world, birth_of_reflection(coat_ggx_.alpha)} : Direction{};
    }
    case kSheenLobe: {
      const SinCos phi = sin_cos(2 * kPi * u2);
      const float z = (1 - u1) * (1 - u1), sine = std::sqrt((1 - z) * (1 + z));  // denser where fibres reflect
      return on_side({sine * phi.cos, sine * phi.sin, z}, z > 0);
    }
    case kDiffuseBelow: {
      const Vec3 wi = sample_cosine_hemisphere(u1, u2);
      return on_side({wi.x, wi.y, -wi.z}, wi.z > 0);
    }
    case kThin: {
      const Vec3 wi = reflect(wo_, thin_ggx_.sample_visible_normal(wo_, u1, u2));
      return on_side({wi.x, wi.y, -wi.z}, wi.z > 0, RayBirth::kTransmission);
    }
    case kGlass: {
      const Vec3 wi = sample_glass(u / probability_[kGlass], u1, u2);
      return on_side(wi, wi != Vec3(0), wi.z < 0 ? RayBirth::kTransmission : birth_of_reflection(ggx_.alpha));
    }
    default: {
      const Vec3 wi = sample_cosine_hemisphere(u1, u2);
      return on_side(wi, wi.z > 0);
    }
  }
}

BsdfSample LayeredBsdf::sample(float u_lobe, float u1, float u2) const {
  if (black_) return {};
  const Direction direction = sample_lobe(u_lobe, u1, u2);
  if (direction.world == Vec3(0)) return {};
  const BsdfValue value = evaluate_world(direction.world, direction.local);
  // An overflow here (grazing by the last ulp) is no direction either, but it is counted.
  if (!std::isfinite(value.pdf)) return {.finite = false};
  if (!(value.pdf > 0)) return {};
  return {direction.world, value.value / value.pdf, value.pdf, true, direction.birth};
}

}  // namespace shoal
