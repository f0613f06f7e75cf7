// The mip levels of one picture: each texel is the mean of the area that it covers in the level before, in linear
// light. At odd sizes the texels at its edges count by their share (as in Guthe and Heckbert 2005,
// "Non-Power-of-Two Mipmap Creation"), so that every texel of level 0 counts alike in 1 x 1. Called by
// engine/tile_textures, one picture at a time. Cost: about 10 bytes a texel of level 0 beside the picture itself;
// one pass a level.
#pragma once

#include <cstdint>
#include <vector>

#include "io/image.h"

namespace shoal {

/// Levels of a full pyramid: down to 1 x 1.
uint32_t full_level_count(uint32_t width, uint32_t height);
inline constexpr uint32_t level_side(uint32_t side, uint32_t level) {
  return (side >> level) > 0 ? side >> level : 1;
}

/// sRGB bytes to linear light and back (to the nearest code), by tables from engine/math.
class SrgbTables {
 public:
  SrgbTables();
  float to_linear(uint8_t code) const { return to_linear_[code]; }
  uint8_t to_code(float linear) const;

 private:
  float to_linear_[256];
  float upper_bound_[255];  ///< below it: this code or a smaller one
};
const SrgbTables& srgb_tables();

/// A level at a time, finest first. Level 0 is the picture's own bytes.
class MipPyramid {
 public:
  /// Takes the picture. Requires: width and height in 1..65536.
  MipPyramid(Image8&& image, bool srgb);

  const Image8& level() const { return level_; }
  uint32_t level_index() const { return index_; }
  /// Moves to the next coarser level; false after 1 x 1.
  bool next();
  /// Mean of the colour channels over level 0, in linear light; alpha's mean in [3].
  void mean(double rgba[4]) const;

 private:
  void quantize();
  bool srgb_;
  uint32_t index_ = 0;
  Image8 level_;
  std::vector<float> linear_;  ///< of level_, 4 a texel; empty at level 0
};

}  // namespace shoal
