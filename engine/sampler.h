// Random numbers as a pure function of (seed, pixel, sample, bounce, dimension): no state, no order, no thread.
// Independent samples from a 4-in-4-out integer hash: pcg4d, Jarzynski & Olano 2020, "Hash Functions for GPU
// Rendering", JCGT 9(3), listing "pcg4d". Called by engine/camera and engine/shade. Cost: about 5 ns for four numbers.
#pragma once

#include <cstdint>

#include "treelets/vector.h"

namespace shoal {

/// Each dimension names four numbers in [0, 1).
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

inline constexpr uint32_t reversed_bits(uint32_t x) {
  x = (x >> 16) | (x << 16);
  x = ((x & 0xff00ff00u) >> 8) | ((x & 0x00ff00ffu) << 8);
  x = ((x & 0xf0f0f0f0u) >> 4) | ((x & 0x0f0f0f0fu) << 4);
  x = ((x & 0xccccccccu) >> 2) | ((x & 0x33333333u) << 2);
  return ((x & 0xaaaaaaaau) >> 1) | ((x & 0x55555555u) << 1);
}

}  // namespace shoal
