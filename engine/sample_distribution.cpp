#include "engine/sample_distribution.h"

#include <algorithm>
#include <cmath>

namespace shoal {
namespace {

/// 1 - 2^-24: keeps a float made from a fraction below one.
constexpr float kBelowOne = 0x1.fffffep-1f;

uint32_t cell(float x, uint32_t count) {
  return std::min(static_cast<uint32_t>(std::clamp(x, 0.0f, 1.0f) * static_cast<float>(count)), count - 1);
}

}  // namespace

Distribution1D::Distribution1D(std::span<const double> weights) {
  cumulative_.reserve(weights.size());
  for (const double w : weights) {
    if (w > 0 && std::isfinite(w)) total_ += w;
    cumulative_.push_back(total_);
  }
  if (!(total_ > 0) || !std::isfinite(total_)) {
    total_ = 0;
    std::fill(cumulative_.begin(), cumulative_.end(), 0.0);
    return;
  }
  for (double& c : cumulative_) c = c == total_ ? 1.0 : c / total_;
}

size_t Distribution1D::sample(double u, double* remainder) const {
  const auto found = std::upper_bound(cumulative_.begin(), cumulative_.end(), u);
  const size_t index = std::min(static_cast<size_t>(found - cumulative_.begin()), cumulative_.size() - 1);
  if (remainder != nullptr) {
    const double low = index == 0 ? 0.0 : cumulative_[index - 1];
    *remainder = std::clamp((u - low) / (cumulative_[index] - low), 0.0, 0x1.fffffffffffffp-1);
  }
  return index;
}

Distribution2D::Distribution2D(std::span<const double> weights, uint32_t width, uint32_t height)
    : Distribution2D(width, height, [&](uint32_t y, std::span<double> row) {
        std::copy_n(weights.begin() + static_cast<ptrdiff_t>(static_cast<size_t>(y) * width), width, row.begin());
      }) {}

Distribution2D::Distribution2D(uint32_t width, uint32_t height,
                               const std::function<void(uint32_t, std::span<double>)>& row)
    : width_(width), height_(height) {
  std::vector<double> weights(width), sums;
  columns_.reserve(height);
  for (uint32_t y = 0; y < height; ++y) {
    row(y, weights);
    columns_.emplace_back(weights);
    sums.push_back(columns_.back().total());
  }
  rows_ = Distribution1D(sums);
}

Vec2 Distribution2D::sample(double u1, double u2, double* pdf) const {
  double inside_u = 0, inside_v = 0;
  const size_t y = rows_.sample(u2, &inside_v);
  const size_t x = columns_[y].sample(u1, &inside_u);
  *pdf = rows_.probability(y) * columns_[y].probability(x) * width_ * height_;
  return {std::min(static_cast<float>((static_cast<double>(x) + inside_u) / width_), kBelowOne),
          std::min(static_cast<float>((static_cast<double>(y) + inside_v) / height_), kBelowOne)};
}

double Distribution2D::pdf(const Vec2& uv) const {
  const uint32_t x = cell(uv.x, width_), y = cell(uv.y, height_);
  const double row = rows_.probability(y);
  return row > 0 ? row * columns_[y].probability(x) * width_ * height_ : 0.0;
}

uint64_t Distribution2D::resident_bytes() const {
  uint64_t bytes = rows_.resident_bytes() + columns_.capacity() * sizeof(Distribution1D);
  for (const Distribution1D& c : columns_) bytes += c.resident_bytes();
  return bytes;
}

}  // namespace shoal
