#include "bins/compare_pictures.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "engine/tonemap.h"

namespace shoal {
namespace {

/// The squares of pixels that a small picture is made of.
struct Squares {
  Squares(uint32_t full_width, uint32_t full_height, uint32_t most_side)
      : width(full_width), height(full_height), side((std::max(full_width, full_height) + most_side - 1) / most_side) {}
  uint32_t columns() const { return (width + side - 1) / side; }
  uint32_t rows() const { return (height + side - 1) / side; }
  /// `look(small, pixel)` at every pixel, with the small one that it is part of.
  template <class Look>
  void each(const Look& look) const {
    for (uint32_t y = 0; y < height; ++y) {
      for (uint32_t x = 0; x < width; ++x) {
        look(size_t{y / side} * columns() + x / side, size_t{y} * width + x);
      }
    }
  }
  uint32_t width, height, side;
};

double largest_difference(const float* a, const float* b) {
  double most = 0;
  for (int c = 0; c < 3; ++c) most = std::max(most, std::abs(double{a[c]} - double{b[c]}));
  return most;
}

}  // namespace

SmallPicture small_picture(const std::vector<float>& rgba, uint32_t width, uint32_t height, uint32_t most_side) {
  const Squares squares(width, height, most_side);
  const size_t pixels = size_t{squares.columns()} * squares.rows();
  std::vector<float> sums[3];
  for (std::vector<float>& sum : sums) sum.resize(pixels);
  std::vector<uint32_t> counts(pixels);
  squares.each([&](size_t small, size_t pixel) {
    for (size_t c = 0; c < 3; ++c) sums[c][small] += rgba[4 * pixel + c];
    ++counts[small];
  });
  for (std::vector<float>& sum : sums) {
    for (size_t i = 0; i < pixels; ++i) sum[i] /= static_cast<float>(counts[i]);
  }
  return {squares.columns(), squares.rows(), tone_map_image(sums[0], sums[1], sums[2], {})};
}

ComparedPicture compare_pictures(const std::string& label, const std::vector<float>& rgba, const std::vector<float>& first,
                                 uint32_t width, uint32_t height, uint32_t most_side) {
  ComparedPicture compared{label, small_picture(rgba, width, height, most_side), {}, 0, 0};
  const Squares squares(width, height, most_side);
  std::vector<double> most(size_t{squares.columns()} * squares.rows());
  squares.each([&](size_t small, size_t pixel) {
    const float *a = &rgba[4 * pixel], *b = &first[4 * pixel];
    if (std::memcmp(a, b, 4 * sizeof(float)) == 0) return;
    ++compared.pixels_differing;
    most[small] = std::max(most[small], largest_difference(a, b));
    compared.max_difference = std::max(compared.max_difference, most[small]);
  });
  compared.difference = {squares.columns(), squares.rows(), {}};
  for (const double difference : most) {
    const double share = compared.max_difference > 0 ? std::sqrt(difference / compared.max_difference) : 0;
    compared.difference.rgb.insert(compared.difference.rgb.end(), 3, static_cast<uint8_t>(std::lround(255 * share)));
  }
  return compared;
}

}  // namespace shoal
