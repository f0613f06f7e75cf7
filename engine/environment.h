// Light from infinitely far: none, one radiance for all directions, or an equirectangular picture.
//
// Picture: glTF axes, +y up. Row 0 is the top (+y); u = 0.5 + atan2(x, -z) / (2 pi), v = acos(y) / pi, so that the
// middle column looks along -z and +x lies to its right. Turned by R degrees about +y, counter-clockwise seen from
// above: what was seen along -z is then seen along -x for R = 90. Filtered bilinearly, wrapping in u. Directions are drawn
// from a 2D distribution of luminance * sin(theta) (Pharr et al., Physically Based Rendering 4e, section 12.5.2).
// A constant sky is not sampled as a light: BSDF sampling already follows it, and a shadow ray could do no better.
// Called by engine/shade and engine/light_sampler. Immutable.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/sample_distribution.h"
#include "io/image.h"
#include "treelets/vector.h"

namespace shoal {

class Environment {
 public:
  Environment() = default;  ///< black
  explicit Environment(const Vec3& radiance) : constant_(radiance) {}
  /// Texels that are negative or not a number count as 0, infinite ones as 65504 (the largest half).
  /// `intensity` >= 0 multiplies them.
  explicit Environment(ImageF image, float rotation_degrees = 0, float intensity = 1);

  bool black() const { return image_.rgb.empty() && constant_ == Vec3(0); }
  /// Directions can be drawn: a picture that is not black.
  bool sampled() const { return distribution_.total() > 0; }
  /// Requires: unit length.
  Vec3 radiance(const Vec3& direction) const;
  /// Solid-angle density of sample(); 0 when not sampled().
  float pdf(const Vec3& direction) const;
  /// Requires: sampled(). A unit direction towards the light; *pdf may be 0 at the poles.
  Vec3 sample(double u1, double u2, float* pdf) const;
  /// Mean luminance over the sphere.
  float mean_luminance() const { return mean_luminance_; }
  uint64_t resident_bytes() const { return image_.rgb.size() * sizeof(float) + distribution_.resident_bytes(); }

 private:
  Vec3 texel(uint32_t x, uint32_t y) const;
  /// Where a direction falls in the picture: v in [0, 1], u in [0, 2).
  Vec2 picture_coordinates(const Vec3& direction) const;

  Vec3 constant_{0};
  ImageF image_;
  Distribution2D distribution_;
  float mean_luminance_ = 0;
  float turn_ = 0;  ///< of the picture, in turns, [0, 1)
};

}  // namespace shoal
