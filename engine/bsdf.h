// The reflectance of a surface: the glTF 2.0 metallic-roughness material with KHR_materials_specular.
//
//   f = (1 - m) (diffuse + specular(F0_d, F90_d)) + m specular(base colour, 1)
//   F0_d = min(dielectric_f0 * specular_color, 1) * specular,  F90_d = specular
//   specular(F0, F90) = D G2 F / (4 cos_o cos_i) * (1 + F0 (1 - E) / E)       Turquin 2019, eq. 16
//   diffuse = base colour / pi * (1 - max channel of the dielectric lobe's directional albedo)
//
// E is the directional albedo of the lobe with F = 1 (engine/energy_table.h). The two factors make a white metal
// reflect everything and keep any mixture at or below one. A material with metallic 0 and specular 0 is Lambertian
// exactly and touches neither GGX nor the tables. Called by engine/shade. Pure; one Bsdf a vertex, on the stack.
#pragma once

#include "engine/energy_table.h"
#include "engine/frame.h"
#include "engine/microfacet.h"
#include "engine/ray_birth.h"
#include "treelets/vector.h"

namespace shoal {

/// A material's values at one point: factors times textures.
struct MaterialSample {
  Vec3 base_color{1};
  float metallic = 0;
  float roughness = 1;  ///< perceptual; alpha = roughness^2, at least kMinAlpha
  float specular = 1;
  Vec3 specular_color{1};
  float dielectric_f0 = 0.04f;

  bool has_specular_lobe() const { return metallic > 0 || specular > 0; }
};

struct BsdfValue {
  Vec3 value{0};  ///< f times |cos| to the shading normal
  float pdf = 0;  ///< solid-angle density with which sample() makes the direction
};

struct BsdfSample {
  Vec3 direction{0};  ///< world space, unit length
  Vec3 weight{0};     ///< value / pdf
  float pdf = 0;      ///< 0: no direction, the path ends
  bool finite = true;  ///< false: it ends because its density is no number
  RayBirth birth = RayBirth::kDiffuse;  ///< the lobe that drew it
};

class Bsdf {
 public:
  static constexpr bool kTransmits = false;  ///< every direction is above the surface

  /// World-space unit vectors. `wo` points away from the surface, dot(geometric, wo) >= 0 and dot(shading, wo) > 0;
  /// otherwise the surface is black. `table` may be null when no material has a specular lobe.
  Bsdf(const MaterialSample& material, const EnergyTable* table, const Vec3& geometric_normal,
       const Vec3& shading_normal, const Vec3& wo);

  static constexpr bool transmits() { return false; }
  bool black() const { return specular_probability_ + diffuse_probability_ == 0; }
  /// Zero when `wi` is below the surface, geometric or shading.
  BsdfValue evaluate(const Vec3& wi) const;
  /// `u_lobe`, `u1`, `u2` uniform in [0, 1).
  BsdfSample sample(float u_lobe, float u1, float u2) const;

 private:
  /// Sets the lobe, takes its share from the diffuse one and returns its albedo (luminance).
  float set_specular(const MaterialSample& material, const EnergyTable& table);
  BsdfValue evaluate_local(const Vec3& wi) const;

  Frame frame_;
  Vec3 geometric_normal_;
  Vec3 wo_;              ///< local
  Vec3 diffuse_{0};      ///< weighted albedo; the lobe is diffuse_ / pi
  Vec3 f0_{0}, f90_{0};  ///< both specular lobes together, with their compensation
  Ggx ggx_{1};
  float lambda_o_ = 0;
  float diffuse_probability_ = 0, specular_probability_ = 0;
};

}  // namespace shoal
