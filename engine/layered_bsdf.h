// The reflectance and transmittance of a surface whose material has layers: the metallic-roughness material of
// engine/bsdf.h with the lobes of KHR_materials_transmission, volume, dispersion, diffuse_transmission, clearcoat,
// sheen, anisotropy and iridescence. Layers from the outside, each taking its directional albedo E from what is below
// (albedo scaling, Estevez & Kulla 2017, section 5; as the diffuse lobe in engine/bsdf.h):
//
//   f = coat + (1 - coat E) [ sheen + (1 - max sheen E) base ]
//   base = m specular(base colour, 1) + (1 - m) [ (1 - v) (specular(F0_d, F90_d) + rest * inner) + v glass ]
//   inner = (1 - t) [ (1 - dt) diffuse + dt diffuse transmission ] + t thin
//   rest = 1 - max channel of the dielectric specular lobe's albedo;  v = t where the material bounds a volume and
//   bends light, else 0;  thin = base colour * the specular lobe mirrored to the other side, over its albedo
//   glass: Walter et al. 2007, eq. 20 and 21 with Schlick's Fresnel term, both halves over the albedo of their sum
//
// Carried is L / n^2, so that eta^2 of eq. 21 cancels: what shines inside a volume shines as bright outside.
// A material without layers has the same bits here as in Bsdf (tested). Called by engine/shade. Pure; on the stack.
#pragma once

#include "engine/bsdf.h"
#include "engine/lobe_tables.h"
#include "engine/sheen.h"

namespace shoal {

/// A material's values at one point, with its layers. The defaults add nothing.
struct LayeredSample : MaterialSample {
  float transmission = 0;
  float ior = 1.5f;             ///< of what is refracted, at the path's wavelength where light is dispersed
  bool volume = false;          ///< bounds a volume; else thin-walled
  bool outside = true;          ///< seen from its front
  bool disperses = false;       ///< `ior` depends on the wavelength
  Vec3 wavelength_weight{1};    ///< of the path's wavelength, for what depends on it
  float clearcoat = 0, clearcoat_roughness = 0;
  Vec3 clearcoat_normal{0};     ///< world space, on wo's side
  Vec3 sheen_color{0};
  float sheen_roughness = 0;
  float anisotropy = 0;
  Vec3 anisotropy_direction{0};  ///< world space: the direction that is rougher; zero: none is known
  float iridescence = 0, film_ior = 1.3f, film_thickness = 0;  ///< nm
  float diffuse_transmission = 0;
  Vec3 diffuse_transmission_color{1};
};

/// What a scene's materials call for; null where none does.
struct LobeTables {
  const EnergyTable* energy = nullptr;
  const GlassTable* glass = nullptr;
  const SheenTable* sheen = nullptr;
  const AnisotropyTable* anisotropy = nullptr;
};

class LayeredBsdf {
 public:
  static constexpr bool kTransmits = true;  ///< directions below the surface are possible

  /// As Bsdf. Requires: the tables of the lobes that the sample has.
  LayeredBsdf(const LayeredSample& material, const LobeTables& tables, const Vec3& geometric_normal,
              const Vec3& shading_normal, const Vec3& wo);

  bool black() const { return black_; }
  /// Some lobe of this one reaches below; else evaluate() is zero there.
  bool transmits() const { return probability_[kDiffuseBelow] + probability_[kThin] + probability_[kGlass] > 0; }
  /// `wi` on either side.
  BsdfValue evaluate(const Vec3& wi) const;
  BsdfSample sample(float u_lobe, float u1, float u2) const;
  /// Whether what evaluate() returns for `wi` is of one wavelength and holds its weight.
  bool of_one_wavelength(const Vec3& wi) const {
    return disperses_ && (!outside_ || glm::dot(geometric_normal_, wi) < 0);
  }

 private:
  enum Lobe { kSpecular, kDiffuse, kCoat, kSheenLobe, kDiffuseBelow, kThin, kGlass, kLobeCount };

  void set_frame(const LayeredSample& m, const Vec3& wo);
  float set_specular(const LayeredSample& m, const LobeTables& tables);
  Vec3 film_f0(const LayeredSample& m, const Vec3& f0, float f90) const;
  void set_inner(const LayeredSample& m, const LobeTables& tables, float rest);
  void set_glass(const LayeredSample& m, const LobeTables& tables, const Vec3& f0, float f90);
  void set_coats(const LayeredSample& m, const LobeTables& tables, const Vec3& wo);
  void choose_probabilities();

  /// Each adds its lobe's value and its density times its probability.
  void add_specular(const Vec3& wi, BsdfValue& sum) const;
  void add_coat(const Vec3& world_wi, BsdfValue& sum) const;
  void add_sheen(const Vec3& wi, BsdfValue& sum) const;
  void add_thin(const Vec3& wi, BsdfValue& sum) const;
  void add_glass_reflection(const Vec3& wi, BsdfValue& sum) const;
  void add_glass_refraction(const Vec3& wi, BsdfValue& sum) const;
  BsdfValue evaluate_world(const Vec3& world_wi, const Vec3& wi) const;
  struct Direction {
    Vec3 local{0}, world{0};  ///< both zero: none
    RayBirth birth = RayBirth::kDiffuse;
  };
  Direction sample_lobe(float u_lobe, float u1, float u2) const;
  Vec3 sample_glass(float u_choice, float u1, float u2) const;  ///< local
  struct GlassSplit {
    Vec3 reflected;       ///< Fresnel reflectance
    float transmitted;    ///< 1 - its largest channel
    float chance;         ///< of reflection when sampling
  };
  /// `cosine` is that of Schlick's term, on the side with the lower index.
  GlassSplit split_glass(float cosine) const;

  Frame frame_, coat_frame_;
  Vec3 geometric_normal_;
  Vec3 wo_{0}, coat_wo_{0};   // local
  Vec3 diffuse_{0}, diffuse_below_{0}, thin_{0}, glass_tint_{0};  // weighted albedos
  Vec3 f0_{0}, f90_{0};       // both specular lobes together, with their compensation
  Vec3 glass_f0_{0};
  float glass_f90_ = 0, glass_weight_ = 0, eta_ = 1;
  float coat_f0_ = 0, coat_f90_ = 0;
  Vec3 sheen_{0};
  Sheen fibres_{1};
  Ggx ggx_{1}, thin_ggx_{1}, coat_ggx_{1};
  GgxAnisotropic stretched_{1, 1};
  bool anisotropic_ = false, black_ = true, outside_ = true, disperses_ = false;
  Vec3 wavelength_weight_{1};
  float lambda_o_ = 0, thin_lambda_o_ = 0, coat_lambda_o_ = 0, glass_lambda_o_ = 0;
  float albedo_[kLobeCount] = {};       // luminance
  float probability_[kLobeCount] = {};
};

}  // namespace shoal
