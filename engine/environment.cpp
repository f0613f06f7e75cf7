#include "engine/environment.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/frame.h"
#include "engine/math.h"

namespace shoal {
namespace {

/// Solid angle per unit of u v area is 2 pi^2 sin(theta).
float solid_angle_pdf(double uv_pdf, float sin_theta) {
  return sin_theta > 0 ? static_cast<float>(uv_pdf / (2.0 * kPi * kPi * sin_theta)) : 0.0f;
}

}  // namespace

Environment::Environment(ImageF image, float rotation_degrees, float intensity) : image_(std::move(image)) {
  for (float& value : image_.rgb) {
    if (!(value > 0)) value = 0;
    if (std::isinf(value)) value = 65504.0f;
    value = std::min(value * intensity, std::numeric_limits<float>::max());
  }
  const double turn = double{rotation_degrees} / 360;
  turn_ = static_cast<float>(turn - std::floor(turn));
  if (turn_ >= 1) turn_ = 0;  // rounded up
  const uint32_t width = image_.width, height = image_.height;
  if (width == 0 || height == 0) {
    image_ = {};
    return;
  }
  // The mean of the bilinear interpolant over each texel (1/8, 6/8, 1/8 a side): a dark texel beside a bright
  // one is not dark.
  double sum = 0, sine_sum = 0;
  distribution_ = Distribution2D(width, height, [&](uint32_t y, std::span<double> weights) {
    const double sine = sin_cos(kPi * (static_cast<float>(y) + 0.5f) / static_cast<float>(height)).sin;
    const uint32_t rows[3] = {y == 0 ? 0 : y - 1, y, std::min(y + 1, height - 1)};
    for (uint32_t x = 0; x < width; ++x) {
      const uint32_t columns[3] = {(x + width - 1) % width, x, (x + 1) % width};
      double mean = 0;
      for (int j = 0; j < 3; ++j) {
        for (int i = 0; i < 3; ++i) {
          mean += (i == 1 ? 0.75 : 0.125) * (j == 1 ? 0.75 : 0.125) * luminance(texel(columns[i], rows[j]));
        }
      }
      weights[x] = mean * sine;
      sum += mean * sine, sine_sum += sine;
    }
  });
  mean_luminance_ = static_cast<float>(sum / sine_sum);
}

Vec3 Environment::texel(uint32_t x, uint32_t y) const {
  const float* p = image_.rgb.data() + (static_cast<size_t>(y) * image_.width + x) * 3;
  return {p[0], p[1], p[2]};
}

Vec2 Environment::picture_coordinates(const Vec3& d) const {
  return {0.5f + arc_tangent(d.x, -d.z) / (2 * kPi) + turn_, arc_cosine(d.y) / kPi};
}

Vec3 Environment::radiance(const Vec3& direction) const {
  if (image_.rgb.empty()) return constant_;
  const Vec2 uv = picture_coordinates(direction);
  const uint32_t width = image_.width, height = image_.height;
  const float x = uv.x * static_cast<float>(width) - 0.5f, y = uv.y * static_cast<float>(height) - 0.5f;
  const float floor_x = std::floor(x), floor_y = std::floor(y);
  const float fx = x - floor_x, fy = y - floor_y;
  const auto column = [width](int64_t i) { return static_cast<uint32_t>((i + width) % width); };
  const auto row = [height](int64_t i) { return static_cast<uint32_t>(std::clamp<int64_t>(i, 0, height - 1)); };
  const uint32_t x0 = column(static_cast<int64_t>(floor_x)), x1 = column(static_cast<int64_t>(floor_x) + 1);
  const uint32_t y0 = row(static_cast<int64_t>(floor_y)), y1 = row(static_cast<int64_t>(floor_y) + 1);
  const Vec3 top = texel(x0, y0) * (1 - fx) + texel(x1, y0) * fx;
  const Vec3 bottom = texel(x0, y1) * (1 - fx) + texel(x1, y1) * fx;
  return top * (1 - fy) + bottom * fy;
}

float Environment::pdf(const Vec3& direction) const {
  if (!sampled()) return 0;
  const float sin_theta = std::sqrt(direction.x * direction.x + direction.z * direction.z);
  Vec2 uv = picture_coordinates(direction);
  if (uv.x >= 1 && turn_ > 0) uv.x -= 1;
  return solid_angle_pdf(distribution_.pdf(uv), sin_theta);
}

Vec3 Environment::sample(double u1, double u2, float* pdf) const {
  double uv_pdf = 0;
  const Vec2 uv = distribution_.sample(u1, u2, &uv_pdf);
  const SinCos theta = sin_cos(kPi * uv.y), phi = sin_cos(2 * kPi * (uv.x - 0.5f - turn_));
  *pdf = solid_angle_pdf(uv_pdf, theta.sin);
  return {theta.sin * phi.sin, theta.cos, -theta.sin * phi.cos};
}

}  // namespace shoal
