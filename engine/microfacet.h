// The GGX microfacet distribution in the local frame of the shading normal (+z), isotropic, with height-correlated
// Smith masking. Formulas: Walter et al. 2007 (D, Lambda), Heitz 2014 "Understanding the Masking-Shadowing
// Function" eq. 99 (G2), Heitz 2018 eq. 17 (pdf of reflected visible normals), Dupuy & Benyoub 2023 listing 3
// (sampling). Called by engine/bsdf and engine/energy_table. Pure functions.
#pragma once

#include <cmath>

#include "treelets/vector.h"

namespace shoal {

/// The smoothest lobe: below it a surface is shaded with this alpha, not as a delta. A half vector of rounded unit
/// vectors is off by about 2^-23, which is 1e-4 of this lobe's width: D keeps three digits. One milliradian is
/// below a pixel of a 1000-pixel, 60 degree picture, so that it still looks like a mirror.
inline constexpr float kMinAlpha = 1e-3f;

/// A view that grazes by less sees nothing of a surface: its cosine is noise (unit vectors of floats are off by 2^-23),
/// and Lambda and densities that divide by it would leave the range of floats.
inline constexpr float kLeastViewCosine = 0x1p-40f;

struct Ggx {
  float alpha;

  /// Density of normals; written with x and y so that nothing cancels near the pole.
  float d(const Vec3& h) const {
    const float inverse = 1 / alpha, x = h.x * inverse, y = h.y * inverse;
    const float k = x * x + y * y + h.z * h.z;
    return 0.31830988618379067f * inverse * inverse / (k * k);
  }
  float lambda(const Vec3& w) const {
    const float z2 = w.z * w.z;
    return 0.5f * (std::sqrt(1 + alpha * alpha * (w.x * w.x + w.y * w.y) / z2) - 1);
  }
  /// Visible normal for `wo` (wo.z > 0) from two uniform numbers.
  Vec3 sample_visible_normal(const Vec3& wo, float u1, float u2) const;
};

/// The same stretched along x and y (Heitz 2014, eq. 85 and 86).
struct GgxAnisotropic {
  float alpha_x, alpha_y;

  float d(const Vec3& h) const {
    const float x = h.x / alpha_x, y = h.y / alpha_y;
    const float k = x * x + y * y + h.z * h.z;
    return 0.31830988618379067f / (alpha_x * alpha_y * k * k);
  }
  float lambda(const Vec3& w) const {
    const float x = alpha_x * w.x, y = alpha_y * w.y;
    return 0.5f * (std::sqrt(1 + (x * x + y * y) / (w.z * w.z)) - 1);
  }
  Vec3 sample_visible_normal(const Vec3& wo, float u1, float u2) const;
};

/// KHR_materials_anisotropy: rougher along x, by mix(alpha, 1, strength^2).
inline GgxAnisotropic anisotropic_ggx(float alpha, float strength) {
  return {alpha + strength * strength * (1 - alpha), alpha};
}

}  // namespace shoal
