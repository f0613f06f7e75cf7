// The sheen lobe of KHR_materials_sheen: microfibres that stand up from a cloth. Estevez & Kulla 2017, "Production
// Friendly Microfacet Sheen BRDF": eq. 2 (the distribution, "Charlie"), eq. 3 and 4 with table 1 (the fitted
// Lambda), without their terminator softening, as the extension has it. Called by engine/layered_bsdf and
// engine/lobe_tables. Pure; about 100 ns.
#pragma once

#include "treelets/vector.h"

namespace shoal {

/// The smoothest sheen: below it the fitted Lambda and the exponent 1 / alpha leave the range they were made for.
inline constexpr float kMinSheenAlpha = 0.02f;

struct Sheen {
  float alpha;  ///< roughness^2, at least kMinSheenAlpha

  float d(const Vec3& h) const;
  float lambda(float cosine) const;  ///< Requires: 0 < cosine <= 1
  /// f cos_i for a white sheen. Requires: wo.z > 0, wi.z > 0.
  float value(const Vec3& wo, const Vec3& wi) const;
};

}  // namespace shoal
