// Random numbers and smooth noise for generated scenes: integer hashes and polynomials, so that the same seed gives
// the same scene on every machine. Called by engine/generate_*. Pure functions; RandomStream is one thread's. Cost:
// about 60 ns an octave of noise.
#pragma once

#include <cstdint>

#include "treelets/vector.h"

namespace shoal {

/// Gradient noise (Perlin 2002, "Improving Noise": quintic fade) with hashed gradients; about [-1, 1], mean 0.
double gradient_noise(double x, double y, double z, uint32_t seed);

/// Sum of `octaves` gradient noises, each at twice the frequency and `gain` times the amplitude of the one before.
double fractal_noise(double x, double y, double z, uint32_t seed, int octaves, double gain = 0.5);

/// The same of 1 - 2 |noise|: sharp ridges, as of weathered rock. Each octave is weighted by the one before
/// (Musgrave, "Texturing and Modeling", ridged multifractal, simplified).
double ridged_noise(double x, double y, double z, uint32_t seed, int octaves, double gain = 0.5);

/// How many octaves from `wavelength` down stay above two cells of size `cell`; 1 .. 14.
int octaves_down_to(double wavelength, double cell);

/// 0 below `from`, 1 above `to`, a cubic between.
double smooth_step(double from, double to, double x);

/// A numbered stream of random numbers.
class RandomStream {
 public:
  RandomStream(uint64_t seed, uint32_t stream) : seed_(seed), stream_(stream) {}
  uint32_t bits();
  /// In [0, 1).
  float uniform();
  float uniform(float from, float to) { return from + (to - from) * uniform(); }
  /// In [0, count). Requires: count > 0.
  uint32_t below(uint32_t count) { return static_cast<uint32_t>((static_cast<uint64_t>(bits()) * count) >> 32); }
  /// Uniform on the unit sphere (rejection from the cube: no trigonometry).
  Vec3 unit_vector();

 private:
  uint64_t seed_;
  uint32_t stream_;
  uint32_t counter_ = 0;
};

}  // namespace shoal
