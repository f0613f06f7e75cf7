// Pieces of the measured pictures for people to look at: one crop, the same of every row, beside its error map.
// Called by engine/accuracy. Plain functions, any thread.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/picture_error.h"
#include "engine/tonemap.h"

namespace shoal {

struct CropPlace {
  uint32_t x = 0, y = 0, width = 0, height = 0;
};
/// The crop of at most 160 x 120 pixels with the largest mean in `map`; the first of equal ones.
CropPlace worst_crop(uint32_t width, uint32_t height, std::span<const float> map);

/// Exposure, in stops, that takes the log-mean luminance of what is not black to 0.18 (Reinhard, Stark, Shirley, Ferwerda
/// 2002, equation 1); 0 for a black picture.
float middle_exposure(std::span<const float> rgb);

/// Linear display colours of a picture.
RgbPicture displayed(std::span<const float> radiance, const ToneMapOptions& tone);

/// The crop of a picture as 8-bit sRGB.
std::vector<uint8_t> crop_colors(std::span<const float> radiance, uint32_t width, const CropPlace& crop,
                                 const ToneMapOptions& tone);
/// The crop of a map with values in [0, 1], as 8-bit sRGB: 0 black, then purple, orange, 1 nearly white (the map "magma"
/// of van der Walt and Smith 2015, as FLIP's authors show it).
std::vector<uint8_t> crop_errors(std::span<const float> map, uint32_t width, const CropPlace& crop);
/// Mean of the map over the crop.
double crop_mean(std::span<const float> map, uint32_t width, const CropPlace& crop);

}  // namespace shoal
