#include "engine/accuracy_views.h"

#include <algorithm>
#include <cmath>

namespace shoal {
namespace {

/// Calls visit(index in the picture) row by row.
template <class Visit>
void each_pixel(uint32_t width, const CropPlace& crop, Visit&& visit) {
  for (uint32_t y = crop.y; y < crop.y + crop.height; ++y) {
    for (uint32_t x = crop.x; x < crop.x + crop.width; ++x) visit(size_t{y} * width + x);
  }
}

constexpr uint8_t kMagma[9][3] = {{0, 0, 4},     {28, 16, 68},   {79, 18, 123},  {129, 37, 129}, {181, 54, 122},
                                  {229, 80, 100}, {251, 135, 97}, {254, 194, 135}, {252, 253, 191}};

}  // namespace

CropPlace worst_crop(uint32_t width, uint32_t height, std::span<const float> map) {
  constexpr uint32_t kStep = 8;
  CropPlace best{0, 0, std::min(width, 160u), std::min(height, 120u)};
  double worst = -1;
  for (uint32_t y = 0; y + best.height <= height; y += kStep) {
    for (uint32_t x = 0; x + best.width <= width; x += kStep) {
      const double mean = crop_mean(map, width, {x, y, best.width, best.height});
      if (mean > worst) worst = mean, best.x = x, best.y = y;
    }
  }
  return best;
}

float middle_exposure(std::span<const float> rgb) {
  double sum = 0;
  size_t lit = 0;
  for (size_t i = 0; i + 2 < rgb.size(); i += 3) {
    const double luminance = 0.2126 * rgb[i] + 0.7152 * rgb[i + 1] + 0.0722 * rgb[i + 2];
    if (luminance > 1e-6) sum += std::log2(luminance), ++lit;
  }
  if (lit == 0) return 0;
  return static_cast<float>(std::log2(0.18) - sum / static_cast<double>(lit));
}

RgbPicture displayed(std::span<const float> radiance, const ToneMapOptions& tone) {
  RgbPicture shown(radiance.size());
  for (size_t i = 0; i + 2 < radiance.size(); i += 3) {
    const Vec3 color = tone_map(Vec3(radiance[i], radiance[i + 1], radiance[i + 2]), tone);
    for (int c = 0; c < 3; ++c) shown[i + static_cast<size_t>(c)] = color[c];
  }
  return shown;
}

std::vector<uint8_t> crop_colors(std::span<const float> radiance, uint32_t width, const CropPlace& crop,
                                 const ToneMapOptions& tone) {
  std::vector<float> planes[3];
  each_pixel(width, crop, [&](size_t at) {
    for (size_t c = 0; c < 3; ++c) planes[c].push_back(radiance[at * 3 + c]);
  });
  return tone_map_image(planes[0], planes[1], planes[2], tone);
}

std::vector<uint8_t> crop_errors(std::span<const float> map, uint32_t width, const CropPlace& crop) {
  std::vector<uint8_t> colors;
  each_pixel(width, crop, [&](size_t at) {
    const float place = std::clamp(map[at], 0.0f, 1.0f) * 8;
    const size_t step = std::min(static_cast<size_t>(place), size_t{7});
    const float share = place - static_cast<float>(step);
    for (size_t c = 0; c < 3; ++c) {
      const float color = static_cast<float>(kMagma[step][c]) * (1 - share) + static_cast<float>(kMagma[step + 1][c]) * share;
      colors.push_back(static_cast<uint8_t>(color + 0.5f));
    }
  });
  return colors;
}

double crop_mean(std::span<const float> map, uint32_t width, const CropPlace& crop) {
  double sum = 0;
  each_pixel(width, crop, [&](size_t at) { sum += map[at]; });
  return sum / (static_cast<double>(crop.width) * crop.height);
}

}  // namespace shoal
