// How wide the ray of a path is: a cone with a width where it begins and an angle by which it grows. Textures are
// looked up at a level of about the cone's footprint (engine/texture_footprint.h); nothing else depends on it.
//
// After Amanatides 1984, "Ray Tracing with Cones", and Akenine-Moeller et al. 2021, "Improved Shader and Texture Level
// of Detail Using Ray Cones", JCGT 10(1), without the term for curvature: behind a curved mirror cones come out
// too narrow, which costs look-ups and blurs nothing. Called by engine/camera, engine/render_worker and engine/shade.
// Cost: a path keeps it in 4 bytes; two multiplications a vertex.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

namespace shoal {

struct RayCone {
  float width = 0;   ///< where the ray begins, world units, >= 0
  float spread = 0;  ///< growth of the width over a unit of length: 2 tan(half the angle), >= 0
};

/// The cone of one sample is this share of a pixel wide: many samples share a pixel, and what they see is averaged again.
/// With half a pixel the helmet's error at 64 samples was 30 % higher than with the finest texels, with a quarter 1 %.
inline constexpr float kConePixelShare = 0.25f;

/// Of the solid angle 1 / pdf that a scattered ray stands for, its cone takes a sixteenth: what is seen by scattered
/// light is blurred by a quarter of the width of the lobe, and seems 3 % wider (square root of 1 + 1/16).
inline constexpr float kConeLobeShare = 1.0f / 16;

/// No cone is wider than about 60 degrees.
inline constexpr float kMaxConeSpread = 1.0f;

/// The cone of a ray that a lobe of density `pdf` (per steradian, > 0) scatters, of a ray whose cone has this width at
/// the surface. A cone of solid angle s has the spread 2 sqrt(s / pi).
inline RayCone scattered_cone(const RayCone& cone, float pdf) {
  constexpr float kInversePi = 0.318309886f;
  const float spread = cone.spread + 2 * std::sqrt(kConeLobeShare * kInversePi / pdf);
  return {cone.width, spread < kMaxConeSpread ? spread : kMaxConeSpread};  // also when pdf underflowed the quotient
}

/// Two halves of a word, each the upper 16 bits of a float, rounded to nearest: relative error 2^-9.
inline uint32_t pack_cone(const RayCone& cone) {
  const auto half = [](float v) {
    const uint32_t bits = std::bit_cast<uint32_t>(v);
    return bits < 0x7f7f8000u ? (bits + 0x8000u) >> 16 : 0x7f7fu;  // beyond it, infinite or not a number: the largest
  };
  return half(cone.width) << 16 | half(cone.spread);
}
inline RayCone unpack_cone(uint32_t packed) {
  return {std::bit_cast<float>(packed & 0xffff0000u), std::bit_cast<float>(packed << 16)};
}

}  // namespace shoal
