#include "engine/noise.h"

#include <cmath>

#include "engine/sampler.h"

namespace shoal {
namespace {

/// One corner's gradient times the offset from it. Gradients are uniform in the cube: three 21-bit fields of pcg4d.
double corner(int32_t ix, int32_t iy, int32_t iz, uint32_t seed, double fx, double fy, double fz) {
  const uint64_t low = static_cast<uint32_t>(ix) | static_cast<uint64_t>(static_cast<uint32_t>(iz)) << 32;
  const Random4 random = random4(low, static_cast<uint32_t>(iy), seed, 0, Dimension::kPixel);
  constexpr double kScale = 0x1p-31;
  const double gx = static_cast<int32_t>(random.bits[0]) * kScale;
  const double gy = static_cast<int32_t>(random.bits[1]) * kScale;
  const double gz = static_cast<int32_t>(random.bits[2]) * kScale;
  return gx * fx + gy * fy + gz * fz;
}

double fade(double t) { return t * t * t * (t * (t * 6 - 15) + 10); }
double lerp(double a, double b, double t) { return a + (b - a) * t; }

// Each octave is shifted by an irrational amount, so that lattice points of different octaves do not coincide.
constexpr double kOctaveShift = 17.320508075688772;

}  // namespace

double gradient_noise(double x, double y, double z, uint32_t seed) {
  const double cx = std::floor(x), cy = std::floor(y), cz = std::floor(z);
  const double fx = x - cx, fy = y - cy, fz = z - cz;
  const auto ix = static_cast<int32_t>(cx), iy = static_cast<int32_t>(cy), iz = static_cast<int32_t>(cz);
  const double u = fade(fx), v = fade(fy), w = fade(fz);
  double plane[2];
  for (int k = 0; k < 2; ++k) {
    double row[2];
    for (int j = 0; j < 2; ++j) {
      const double a = corner(ix, iy + j, iz + k, seed, fx, fy - j, fz - k);
      const double b = corner(ix + 1, iy + j, iz + k, seed, fx - 1, fy - j, fz - k);
      row[j] = lerp(a, b, u);
    }
    plane[k] = lerp(row[0], row[1], v);
  }
  return 1.5 * lerp(plane[0], plane[1], w);  // the raw sum seldom leaves [-0.65, 0.65]
}

double fractal_noise(double x, double y, double z, uint32_t seed, int octaves, double gain) {
  double sum = 0, amplitude = 1;
  for (int octave = 0; octave < octaves; ++octave) {
    sum += amplitude * gradient_noise(x, y, z, seed + static_cast<uint32_t>(octave));
    amplitude *= gain;
    x = x * 2 + kOctaveShift, y = y * 2 + kOctaveShift, z = z * 2 - kOctaveShift;
  }
  return sum;
}

double ridged_noise(double x, double y, double z, uint32_t seed, int octaves, double gain) {
  double sum = 0, amplitude = 1, weight = 1;
  for (int octave = 0; octave < octaves; ++octave) {
    const double ridge = 1 - 2 * std::abs(gradient_noise(x, y, z, seed + static_cast<uint32_t>(octave)));
    sum += amplitude * weight * ridge;
    weight = std::min(1.0, std::max(0.0, 0.5 + 0.5 * ridge));
    amplitude *= gain;
    x = x * 2 + kOctaveShift, y = y * 2 + kOctaveShift, z = z * 2 - kOctaveShift;
  }
  return sum;
}

int octaves_down_to(double wavelength, double cell) {
  int octaves = 1;
  while (octaves < 14 && wavelength > 4 * cell) wavelength *= 0.5, ++octaves;
  return octaves;
}

double smooth_step(double from, double to, double x) {
  const double t = std::min(1.0, std::max(0.0, (x - from) / (to - from)));
  return t * t * (3 - 2 * t);
}

uint32_t RandomStream::bits() { return random4(seed_, stream_, counter_++, 0x5eed, Dimension::kPixel).bits[0]; }

float RandomStream::uniform() { return static_cast<float>(bits() >> 8) * 0x1p-24f; }

Vec3 RandomStream::unit_vector() {
  for (;;) {
    const float x = uniform(-1, 1), y = uniform(-1, 1), z = uniform(-1, 1);
    const float length_squared = x * x + y * y + z * z;
    if (length_squared > 1 || length_squared < 1e-4f) continue;
    return Vec3(x, y, z) / std::sqrt(length_squared);
  }
}

}  // namespace shoal
