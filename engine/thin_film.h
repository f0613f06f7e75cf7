// Iridescence: the reflectance of a thin film on a base, as an RGB colour. Belcour & Barla 2017, "A Practical Extension
// to Microfacet Theory for the Modeling of Varying Iridescence", with the simplifications of KHR_materials_iridescence:
// Schlick's Fresnel term without polarisation at both interfaces, the base's index from its F0, two orders of
// interference. Called by engine/layered_bsdf. Pure; about 300 ns.
#pragma once

#include "treelets/vector.h"

namespace shoal {

/// In [0, 1] by channel. The film lies in air. Requires: 0 < cosine <= 1, film_ior >= 1, thickness_nm >= 0.
Vec3 thin_film_reflectance(float cosine, float film_ior, float thickness_nm, const Vec3& base_f0);

}  // namespace shoal
