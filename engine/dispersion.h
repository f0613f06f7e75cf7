// Dispersion: the index of refraction at a wavelength, and what a wavelength is worth as a colour. A path that is
// refracted by a dispersive material carries one wavelength from there on, drawn evenly from the range below
// (a function of pixel and sample). Called by engine/shade. Pure.
#pragma once

#include <algorithm>

#include "treelets/vector.h"

namespace shoal {

/// No index is larger: dispersion has no bound in a file.
inline constexpr float kLargestIor = 1000;
inline constexpr float kShortestWave = 400, kLongestWave = 700;  ///< nm

/// Cauchy's equation with two terms through n_d and the Abbe number V = 20 / dispersion (KHR_materials_dispersion).
inline float dispersed_ior(float ior, float dispersion, float nanometres) {
  const float inverse_abbe = dispersion / 20;
  const float at_wave = ior + (ior - 1) * inverse_abbe * (523655 / (nanometres * nanometres) - 1.5168f);
  return std::clamp(at_wave, 1.0f, kLargestIor);
}

/// Tents between 450, 550 and 650 nm, thrice, so that each channel's mean over the range is 1: white stays white, no
/// weight is negative, and a spectrum runs through its colours. Not the eye's response: RGB has no spectrum to keep.
inline Vec3 wavelength_weight(float nanometres) {
  const float blue = std::clamp((550 - nanometres) / 100, 0.0f, 1.0f);
  const float red = std::clamp((nanometres - 550) / 100, 0.0f, 1.0f);
  return 3.0f * Vec3(red, 1 - red - blue, blue);
}

}  // namespace shoal
