#include "engine/generate_textures.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/math.h"
#include "engine/noise.h"
#include "io/png_writer.h"

namespace shoal {
namespace {

uint8_t quantize(float value) { return static_cast<uint8_t>(glm::clamp(value, 0.0f, 1.0f) * 255.0f + 0.5f); }

/// How far (x, y) lies inside a pointed leaf from (0, 0) to (length, 0), relative to its half width; below 0
/// outside.
float inside_leaf(float x, float y, float length, float half_width) {
  const float t = x / length;
  if (t <= 0 || t >= 1) return -1;
  const float edge = half_width * 3.2f * t * (1 - t) * (1.25f - 0.5f * t);
  return 1 - std::abs(y) / edge;
}

}  // namespace

Status write_texture(const GenerateContext& context, const std::string& name, uint32_t width, uint32_t height,
                     const Paint& paint, GenerateReport& report) {
  std::vector<uint8_t> rgba(size_t{4} * width * height);
  oneapi::tbb::parallel_for(uint32_t{0}, height, [&](uint32_t y) {
    for (uint32_t x = 0; x < width; ++x) {
      const Vec4 texel = paint((static_cast<float>(x) + 0.5f) / static_cast<float>(width),
                               (static_cast<float>(y) + 0.5f) / static_cast<float>(height));
      for (int c = 0; c < 4; ++c) rgba[(size_t{y} * width + x) * 4 + c] = quantize(texel[c]);
    }
  });
  const std::string path = context.options.out_dir + "/" + name;
  SHOAL_RETURN_IF_ERROR(write_png_rgba(context.fs, path, width, height, rgba));
  report.file_bytes += rgba.size();
  return {};
}

Vec4 normal_texel(double slope_u, double slope_v) {
  // +y of the tangent frame runs against v (glTF 2.0 section 3.9.3: green up).
  const double length = std::sqrt(slope_u * slope_u + slope_v * slope_v + 1);
  return Vec4(0.5 - 0.5 * slope_u / length, 0.5 + 0.5 * slope_v / length, 0.5 + 0.5 / length, 1);
}

Vec4 paint_leaves(float u, float v) {
  const float x = u - 0.5f, y = 1 - v;
  if (std::abs(x) < 0.008f && y < 0.9f) return Vec4(0.36f, 0.27f, 0.16f, 1);
  float best = -1;
  for (int k = 0; k < 9; ++k) {
    const float from = 0.04f + 0.1f * static_cast<float>(k);
    const float side = k % 2 == 0 ? 1.0f : -1.0f;
    const float cosine = 0.8f, sine = 0.6f;
    const float px = side * x, py = y - from;
    const float reach = 0.46f - 0.028f * static_cast<float>(k);
    best = std::max(best, inside_leaf(px * cosine + py * sine, py * cosine - px * sine, reach, 0.1f));
  }
  if (best < 0) return Vec4(0.3f, 0.45f, 0.15f, 0);
  const float vein = best > 0.9f ? 0.12f : 0.0f;
  return Vec4(0.30f + 0.15f * best + vein, 0.50f + 0.16f * best + vein, 0.16f + vein, 1);
}

Vec4 paint_frond(float u, float v) {
  const float x = std::abs(u - 0.5f), y = 1 - v;
  const float stem = 1 - x / 0.012f;
  float best = std::min(1.0f, stem);
  for (int k = 0; k < 16; ++k) {
    const float from = 0.03f + 0.058f * static_cast<float>(k);
    const float reach = 0.47f * (1 - static_cast<float>(k) / 17.0f) + 0.03f;
    const float px = x, py = y - from;
    best = std::max(best, 0.8f * inside_leaf(px * 0.9f + py * 0.436f, py * 0.9f - px * 0.436f, reach, 0.035f));
  }
  const float alpha = glm::clamp(best * 2.2f, 0.0f, 1.0f);
  return Vec4(0.30f, 0.44f + 0.1f * y, 0.16f, alpha);
}

Vec4 paint_sea_fan(float u, float v, uint32_t seed) {
  // Ribs radiate from the foot; rungs cross them: cells of a warped polar grid.
  const double x = u - 0.5, y = 1.02 - v;
  const double warp = 0.05 * fractal_noise(u * 6, v * 6, 1, seed, 3);
  const double radius = std::sqrt(x * x + y * y);
  const double slope = (x + warp * radius) / (y + 0.35);
  const double rim = 0.98 - 0.9 * slope * slope + 0.06 * gradient_noise(slope * 9, 2, 0, seed + 3);
  if (radius > rim) return Vec4(0.8f, 0.2f, 0.3f, 0);
  const auto line = [](double at, double width) {
    const double near = std::abs(at - std::floor(at) - 0.5);
    return near < width;
  };
  const bool stem = std::abs(x + warp * 0.5) < 0.022 * (1.05 - radius) + 0.004;
  const bool rib = line(slope * (radius > 0.55 ? 36 : radius > 0.28 ? 18 : 9) + 0.5 + 3 * warp, 0.17);
  const bool rung =
      radius > 0.1 && line(radius * 34 + 6 * warp + 2.5 * gradient_noise(u * 22, v * 22, 0, seed + 9), 0.15);
  const float shade = static_cast<float>(0.86 + 0.14 * gradient_noise(u * 30, v * 30, 5, seed));
  return Vec4(0.93f * shade, 0.36f * shade, 0.42f * shade, stem || rib || rung ? 1 : 0);
}

Vec4 paint_marble(float u, float v, uint32_t seed) {
  // On the sphere that the texture goes round, so that it has no seam.
  const SinCos turn = sin_cos(2 * kPi * u), polar = sin_cos(kPi * v);
  const double x = 2.2 * polar.sin * turn.cos, y = 2.2 * polar.cos, z = 2.2 * polar.sin * turn.sin;
  const double warp = fractal_noise(x, y, z, seed, 6);
  const double vein = std::abs(gradient_noise(x + 1.3 * warp, y - 1.1 * warp, z + 0.9 * warp, seed + 7));
  const double line = 1 - smooth_step(0.0, 0.16, vein);
  const double cloud = 0.06 * fractal_noise(x * 2, y * 2, z * 2, seed + 9, 4);
  const Vec3 white(0.90f, 0.89f, 0.87f), dark(0.20f, 0.30f, 0.33f);
  return Vec4(glm::mix(white - Vec3(static_cast<float>(cloud)), dark, static_cast<float>(0.85 * line)), 1);
}

Vec4 paint_sea(float u, float v) {
  // v = 0.89 is the horizon of sea_dome, which goes to 101 degrees from the zenith.
  const float x = (u - 0.49f) / 0.11f, y = (v - 0.86f) / 0.16f;
  const float glow = 1 / (1 + 1.6f * (x * x + y * y));
  const Vec3 deep(0.04f, 0.22f, 0.37f), shallow(0.52f, 0.80f, 0.88f), light(0.66f, 0.97f, 0.95f);
  Vec3 color = glm::mix(shallow, deep, static_cast<float>(smooth_step(0.25, 0.92, v)));
  color = glm::mix(color, light, 0.95f * glow);
  return Vec4(color, 1);
}

Vec4 paint_caustics(float u, float v, uint32_t seed) {
  // Caustics are where a warped sheet folds: thin lines around cells, two scales of them.
  const double x = u * 44, y = v * 44;
  const double wx = 0.55 * gradient_noise(x * 0.7, y * 0.7, 4, seed),
               wy = 0.55 * gradient_noise(x * 0.7, y * 0.7, 8, seed);
  const double a = std::abs(gradient_noise(x + wx, y + wy, 0, seed + 1));
  const double b = std::abs(gradient_noise(1.9 * x - wy, 1.9 * y + wx, 2, seed + 2));
  const double lines = std::max(1 - smooth_step(0.0, 0.17, a), 0.75 * (1 - smooth_step(0.0, 0.15, b)));
  const double passed = 0.34 + 0.66 * smooth_step(0.10, 0.75, lines);
  return Vec4(0.86f, 0.94f, 0.95f, 1 - passed);
}

}  // namespace shoal
