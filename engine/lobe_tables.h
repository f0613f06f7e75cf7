// Directional albedos of the lobes that only some scenes call for, tabulated by deterministic quadrature over visible
// normals when a scene does: refracting glass, sheen, anisotropic reflection. They make each lobe keep its energy
// (Turquin 2019; for glass: both halves divided by what they send out together, as Kulla & Conty 2017, section "Glass").
// Called by engine/layered_bsdf. Immutable; a look-up is a cubic interpolation.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/energy_table.h"
#include "engine/microfacet.h"
#include "treelets/vector.h"

namespace shoal {

/// Where refracted light goes: `eta` is the index below the surface over the index on wo's side. False: total
/// reflection. `cos_t` > 0.
bool refract(const Vec3& wo, const Vec3& h, float eta, float& cos_t, Vec3& wi);

/// What glass without compensation reflects and transmits, split for Schlick's term F = F0 (1 - S) + F90 S:
/// reflects F0 a + F90 b + total, transmits (1 - F0) c + (1 - F90) d.
struct GlassAlbedo {
  float a = 0, b = 0, total = 0, c = 0, d = 0;
  float sum(float f0, float f90) const { return f0 * a + f90 * b + total + (1 - f0) * c + (1 - f90) * d; }
};
GlassAlbedo integrate_glass_albedo(float mu, float alpha, float eta, int count);

/// Nearer to 1 than this an index bends no light: half vectors of rounded directions would be noise.
inline constexpr float kLeastBending = 1e-3f;
inline bool bends_light(float ior) { return std::abs(ior - 1) >= kLeastBending; }

class GlassTable {
 public:
  /// `indices` of refraction, of volumes: each has its own slice, unless they are many.
  explicit GlassTable(std::vector<float> indices, unsigned threads = 1);
  /// Requires: 0 < mu <= 1, kMinAlpha <= alpha <= 1; eta or 1 / eta is one of the indices or between two.
  GlassAlbedo albedo(float mu, float alpha, float eta) const;
  uint64_t resident_bytes() const { return cells_.size() * sizeof(GlassAlbedo) + places_.size() * sizeof(float); }

 private:
  std::vector<float> places_;       ///< of the indices, increasing
  std::vector<GlassAlbedo> cells_;  ///< [index][into it, out of it][alpha][mu]
};

float integrate_sheen_albedo(float mu, float alpha, int steps);

class SheenTable {
 public:
  explicit SheenTable(unsigned threads = 1);
  /// Requires: 0 < mu <= 1, kMinSheenAlpha <= alpha <= 1.
  float albedo(float mu, float alpha) const;
  uint64_t resident_bytes() const { return cells_.size() * sizeof(float); }

 private:
  std::vector<float> cells_;  ///< [alpha][mu]
};

SpecularAlbedo integrate_anisotropic_albedo(const Vec3& wo, const GgxAnisotropic& ggx, int count);

class AnisotropyTable {
 public:
  explicit AnisotropyTable(unsigned threads = 1);
  /// Requires: wo.z > 0, kMinAlpha <= alpha_y <= alpha_x <= 1.
  SpecularAlbedo albedo(const Vec3& wo, const GgxAnisotropic& ggx) const;
  uint64_t resident_bytes() const { return cells_.size() * sizeof(SpecularAlbedo); }

 private:
  std::vector<SpecularAlbedo> cells_;  ///< [stretch][alpha_y][phi][mu]
};

}  // namespace shoal
