// Directional albedos of the lobes that only some scenes call for, tabulated by deterministic quadrature over visible
// normals when a scene does: refracting glass, sheen, anisotropic reflection. They make each lobe keep its energy
// (Turquin 2019; for glass: both halves divided by what they send out together, as Kulla & Conty 2017, section "Glass").
// Called by engine/layered_bsdf. Immutable; a look-up is a multilinear interpolation.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/energy_table.h"
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
GlassAlbedo integrate_glass_albedo(float mu, float alpha, float eta, int steps);

class GlassTable {
 public:
  GlassTable();
  /// Requires: 0 < mu <= 1, kMinAlpha <= alpha <= 1, eta > 0. Beyond the table's range (an index of 4) its border.
  GlassAlbedo albedo(float mu, float alpha, float eta) const;
  uint64_t resident_bytes() const { return cells_.size() * sizeof(GlassAlbedo); }

 private:
  std::vector<GlassAlbedo> cells_;  ///< [eta][alpha][mu]
};

float integrate_sheen_albedo(float mu, float alpha, int steps);

class SheenTable {
 public:
  SheenTable();
  /// Requires: 0 < mu <= 1, kMinSheenAlpha <= alpha <= 1.
  float albedo(float mu, float alpha) const;
  uint64_t resident_bytes() const { return cells_.size() * sizeof(float); }

 private:
  std::vector<float> cells_;  ///< [alpha][mu]
};

/// Of GGX with alpha_x = mix(alpha, 1, strength^2) and alpha_y = alpha (KHR_materials_anisotropy).
SpecularAlbedo integrate_anisotropic_albedo(const Vec3& wo, float alpha, float strength, int steps);

class AnisotropyTable {
 public:
  AnisotropyTable();
  /// Requires: wo.z > 0, kMinAlpha <= alpha <= 1, 0 <= strength <= 1.
  SpecularAlbedo albedo(const Vec3& wo, float alpha, float strength) const;
  uint64_t resident_bytes() const { return cells_.size() * sizeof(SpecularAlbedo); }

 private:
  std::vector<SpecularAlbedo> cells_;  ///< [strength][alpha][phi][mu]
};

}  // namespace shoal
