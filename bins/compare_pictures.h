// Small copies of pictures and of what tells two apart, for the page of `shoal compare`. Called by bins/command_compare,
// with at most two whole pictures in memory. Plain functions. Cost: one pass over the pixels.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace shoal {

struct SmallPicture {
  uint32_t width = 0, height = 0;
  std::vector<uint8_t> rgb;  ///< 8-bit sRGB
};

/// The picture of an order and how it differs from the first one.
struct ComparedPicture {
  std::string label;
  SmallPicture picture;
  SmallPicture difference;       ///< black where no channel differs; its largest difference is white
  uint64_t pixels_differing = 0; ///< in any bit of their four channels
  double max_difference = 0;     ///< of a colour channel
};

/// `rgba`: linear, width * height * 4. Each pixel is the mean of the square it stands for, tone-mapped as PNGs are; at most
/// `most_side` wide and high, never larger than the picture.
SmallPicture small_picture(const std::vector<float>& rgba, uint32_t width, uint32_t height, uint32_t most_side);

/// Both of one size. The difference has the size of small_picture().
ComparedPicture compare_pictures(const std::string& label, const std::vector<float>& rgba, const std::vector<float>& first,
                                 uint32_t width, uint32_t height, uint32_t most_side);

}  // namespace shoal
