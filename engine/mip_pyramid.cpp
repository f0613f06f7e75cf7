#include "engine/mip_pyramid.h"

#include <algorithm>

#include "engine/math.h"

namespace shoal {

namespace {

/// The source texels under texel `i` of `coarse`, of a row or column of `fine`, with their shares.
struct Footprint {
  uint32_t first, count;  ///< at most 3
  float weight[3];
};

/// Texel i covers [i * fine / coarse, (i + 1) * fine / coarse): with fine = 2 * coarse + 1 it touches three texels.
Footprint footprint(uint32_t i, uint32_t fine, uint32_t coarse) {
  if (fine == coarse) return {i, 1, {1, 0, 0}};
  if (fine == 2 * coarse) return {2 * i, 2, {0.5f, 0.5f, 0}};
  const float n = static_cast<float>(fine);
  return {2 * i,
          3,
          {static_cast<float>(coarse - i) / n, static_cast<float>(coarse) / n, static_cast<float>(i + 1) / n}};
}

}  // namespace

uint32_t full_level_count(uint32_t width, uint32_t height) {
  uint32_t count = 1;
  for (uint32_t side = std::max(width, height); side > 1; side >>= 1) ++count;
  return count;
}

SrgbTables::SrgbTables() {
  for (int code = 0; code < 256; ++code) to_linear_[code] = srgb_to_linear(static_cast<float>(code) / 255.0f);
  for (int code = 0; code < 255; ++code) {
    upper_bound_[code] = srgb_to_linear((static_cast<float>(code) + 0.5f) / 255.0f);
  }
}

uint8_t SrgbTables::to_code(float linear) const {
  return static_cast<uint8_t>(std::upper_bound(upper_bound_, upper_bound_ + 255, linear) - upper_bound_);
}

const SrgbTables& srgb_tables() {
  static const SrgbTables tables;
  return tables;
}

MipPyramid::MipPyramid(Image8&& image, bool srgb) : srgb_(srgb), level_(std::move(image)) {}

void MipPyramid::mean(double rgba[4]) const {
  const SrgbTables& srgb = srgb_tables();
  uint64_t counts[4][256] = {};
  for (size_t i = 0; i < level_.rgba.size(); ++i) ++counts[i & 3][level_.rgba[i]];
  const double n = static_cast<double>(level_.rgba.size() / 4);
  for (int c = 0; c < 4; ++c) {
    double sum = 0;
    for (int code = 0; code < 256; ++code) {
      const double value = srgb_ && c < 3 ? srgb.to_linear(static_cast<uint8_t>(code)) : code / 255.0;
      sum += value * static_cast<double>(counts[c][code]);
    }
    rgba[c] = sum / n;
  }
}

bool MipPyramid::next() {
  if (level_.width == 1 && level_.height == 1) return false;
  const uint32_t width = level_side(level_.width, 1), height = level_side(level_.height, 1);
  const SrgbTables& srgb = srgb_tables();
  float code_value[2][256];  // [alpha][code]
  for (int code = 0; code < 256; ++code) {
    code_value[1][code] = static_cast<float>(code) / 255.0f;
    code_value[0][code] = srgb_ ? srgb.to_linear(static_cast<uint8_t>(code)) : code_value[1][code];
  }
  std::vector<float> coarse(size_t{4} * width * height);
  for (uint32_t y = 0; y < height; ++y) {
    const Footprint rows = footprint(y, level_.height, height);
    for (uint32_t x = 0; x < width; ++x) {
      const Footprint columns = footprint(x, level_.width, width);
      float* out = &coarse[(size_t{y} * width + x) * 4];
      for (uint32_t j = 0; j < rows.count; ++j) {
        for (uint32_t i = 0; i < columns.count; ++i) {
          const size_t in = (size_t{rows.first + j} * level_.width + columns.first + i) * 4;
          const float weight = rows.weight[j] * columns.weight[i];
          for (int c = 0; c < 4; ++c) {
            const float value = linear_.empty() ? code_value[c == 3][level_.rgba[in + c]] : linear_[in + c];
            out[c] += weight * value;
          }
        }
      }
    }
  }
  linear_ = std::move(coarse);
  level_.width = width, level_.height = height;
  ++index_;
  quantize();
  return true;
}

void MipPyramid::quantize() {
  const SrgbTables& srgb = srgb_tables();
  level_.rgba.resize(linear_.size());
  for (size_t i = 0; i < linear_.size(); ++i) {
    const bool encoded = srgb_ && (i & 3) != 3;
    level_.rgba[i] =
        encoded ? srgb.to_code(linear_[i]) : static_cast<uint8_t>(std::min(linear_[i], 1.0f) * 255.0f + 0.5f);
  }
}

}  // namespace shoal
