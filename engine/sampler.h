// Random numbers as a pure function of (seed, pixel, sample, bounce, dimension): no state, no order, no thread.
//
// kIndependent: a 4-in-4-out integer hash, pcg4d: Jarzynski & Olano 2020, "Hash Functions for GPU Rendering",
// JCGT 9(3), listing "pcg4d".
// kSobol: each (pixel, bounce, dimension) has the points of a Sobol sequence to itself, in an order and with an Owen
// scrambling of its own ("padding", Burley 2020, section 4; engine/sobol.h). So the samples of a pixel are spread evenly
// over what one dimension decides, in every prefix of 2^k samples, and are independent between dimensions and pixels.
// kBlueNoise: each (bounce, dimension) has one Sobol sequence for the whole picture: pixels take runs of it along a
// Z-curve whose quadrants come in a random order at every level (Ahmed & Wonka 2020, "Screen-Space Blue-Noise
// Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of Pixels", ACM TOG 39(6), section 4). Neighbours
// share a larger net, so that their errors cancel: of high frequency, which the eye and filters take for less. The
// points of a sample depend on the samples a pixel has, rounded up to a power of two.
//
// Called by engine/camera, engine/path_ray and engine/shade. Cost of a draw in instructions: see docs/sampling.md.
#pragma once

#include <cstdint>

#include "treelets/vector.h"

namespace shoal {

/// Each dimension names four numbers in [0, 1). Those of kLight and kBsdf are a choice (0, and with more digits 0 and 3)
/// and a point of a square (1, 2); kPixel and kLens ask for a point (0, 1), the others for one number (0).
enum class Dimension : uint32_t {
  kPixel = 0,
  kLens = 1,
  kLight = 2,
  kBsdf = 3,
  kRoulette = 4,
  kCoverage = 5,
  kWavelength = 6,
  kTexture = 7,
  kTime = 8
};

struct Random4 {
  uint32_t bits[4];
  /// In [0, 1): the upper 24 bits.
  float uniform(int i) const { return static_cast<float>(bits[i] >> 8) * 0x1p-24f; }
};

/// Neighbouring seeds permute what they are given: Sampler hashes them first.
inline Random4 random4(uint64_t seed, uint32_t pixel, uint32_t sample, uint32_t bounce, Dimension dimension) {
  uint32_t x = pixel ^ static_cast<uint32_t>(seed);
  uint32_t y = sample ^ static_cast<uint32_t>(seed >> 32);
  uint32_t z = bounce;
  uint32_t w = static_cast<uint32_t>(dimension);
  x = x * 1664525u + 1013904223u, y = y * 1664525u + 1013904223u;
  z = z * 1664525u + 1013904223u, w = w * 1664525u + 1013904223u;
  x += y * w, y += z * x, z += x * y, w += y * z;
  x ^= x >> 16, y ^= y >> 16, z ^= z >> 16, w ^= w >> 16;
  x += y * w, y += z * x, z += x * y, w += y * z;
  return {{x, y, z, w}};
}

enum class SamplerKind : uint8_t { kIndependent, kSobol, kBlueNoise };

/// What the samples of a pixel are to each other.
enum class SampleSets : uint8_t {
  kOne,     ///< spread evenly together
  kHalves,  ///< those with even and those with odd numbers are independent of each other, each spread evenly
};

/// The samples of one picture. Immutable.
class Sampler {
 public:
  /// Of a picture with `samples` a pixel. Only kBlueNoise asks for its size and samples; more of either than said here
  /// are as good, but not blue.
  Sampler(SamplerKind kind, uint64_t seed, uint32_t width, uint32_t height, uint32_t samples,
          SampleSets sets = SampleSets::kOne);

  /// Whether pictures of so many samples draw the same numbers, as far as both have them.
  static bool same_numbers(SamplerKind kind, uint32_t samples, uint32_t others, SampleSets sets) {
    return kind != SamplerKind::kBlueNoise || bits_of(samples, sets) == bits_of(others, sets);
  }

  Random4 draw(uint32_t pixel, uint32_t sample, uint32_t bounce, Dimension dimension) const {
    if (kind_ == SamplerKind::kIndependent) return hash(pixel, sample, bounce, dimension);
    return kind_ == SamplerKind::kSobol ? draw_sobol(pixel, sample, bounce, dimension)
                                        : draw_blue_noise(pixel, sample, bounce, dimension);
  }
  /// Independent of each other whatever the kind: for what hashes them on.
  Random4 hash(uint32_t pixel, uint32_t sample, uint32_t bounce, Dimension dimension) const {
    return random4(seed_, pixel, sample, bounce, dimension);
  }

 private:
  /// Blue noise: of the samples of one set.
  static uint32_t bits_of(uint32_t samples, SampleSets sets);
  Random4 draw_sobol(uint32_t pixel, uint32_t sample, uint32_t bounce, Dimension dimension) const;
  Random4 draw_blue_noise(uint32_t pixel, uint32_t sample, uint32_t bounce, Dimension dimension) const;

  SamplerKind kind_;
  uint64_t seed_;              ///< hashed
  uint32_t width_;
  uint32_t half_bits_;         ///< so many of a sample's last bits say which half it is of
  uint32_t sample_bits_ = 0;   ///< blue noise: an index is that of a pixel in its tile, then so many bits of the sample
  uint32_t tile_levels_ = 0;   ///< ... and a tile is 2^tile_levels_ pixels wide
};

}  // namespace shoal
