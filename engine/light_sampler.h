// One light sample a vertex: which light, which point or direction on it, and with what density.
//
// Lights are: all emissive triangles together, each punctual light, and an environment picture. One is chosen with
// fixed probabilities, half by power and half evenly, so that neither a dim light nearby nor a bright one far away
// is starved. Powers: emitters 2 pi * sum(area * luminance), point 4 pi I, spot 2 pi (1 - cos outer) I, directional
// pi R^2 E, environment 4 pi^2 R^2 * mean luminance (R: half the diagonal of the scene).
// Among emissive triangles the probability is proportional to area * Material::emission_weight, and the
// point is uniform: the density by area is emission_weight / total, known from a material alone (emitter_pdf).
// Called by engine/shade. Immutable; a sample costs two binary searches.
#pragma once

#include <cstdint>

#include "engine/environment.h"
#include "engine/sample_distribution.h"
#include "engine/scene.h"
#include "engine/surface_error.h"

namespace shoal {

/// Numbers in [0, 1) for one light sample.
struct LightRandom {
  double choice;
  double u1, u2;
};

struct LightSample {
  Vec3 direction{0};   ///< unit, from the vertex to the light
  Vec3 radiance{0};    ///< arriving; of an emitter 1, to be multiplied by its emission. Delta: irradiance
  double pdf = 0;      ///< solid angle, times the chance of the light; 0: no sample. Delta: the chance alone
  bool delta = false;  ///< punctual: BSDF sampling never finds it
  const Emitter* emitter = nullptr;
  Vec2 emitter_uv{0};  ///< of the emissive texture
  bool at_infinity = false;
  BoundedPoint target;                 ///< where the shadow ray ends, unless at_infinity
  const Instance* instance = nullptr;  ///< that the emitter belongs to
  Vec3 target_normal{0};               ///< unit, towards the vertex; zero: a point without a surface
};

class LightSampler {
 public:
  /// Keeps references to both.
  LightSampler(const Scene& scene, const Environment& environment);

  bool empty() const { return !(lights_.total() > 0); }
  /// Requires: !empty().
  LightSample sample(const Vec3& position, const LightRandom& random) const;

  /// Density by area with which sample() finds a point on an emitter of this material; 0 when it never does.
  double emitter_pdf(const Material& material) const { return emitter_density_ * sampled_weight(material); }
  /// Solid-angle density with which sample() finds a direction to the environment.
  double environment_pdf(const Vec3& direction) const;
  uint64_t resident_bytes() const { return lights_.resident_bytes() + emitters_.resident_bytes(); }

 private:
  /// Emitters with coverage are found by chance only: a shadow ray ends before the emitter and so cannot ask whether
  /// the emitter is there.
  static double sampled_weight(const Material& material) {
    return material.coverage == CoverageMode::kOpaque ? material.emission_weight : 0.0f;
  }
  void weigh_emitters();
  LightSample sample_emitter(const Vec3& position, double chance, double choice, const LightRandom& random) const;
  LightSample sample_punctual(const PunctualLight& light, const Vec3& position, double chance) const;
  LightSample sample_environment(double chance, const LightRandom& random) const;

  const Scene* scene_;
  const Environment* environment_;
  Distribution1D lights_;  ///< punctual lights, then the emitters as one, then the environment
  Distribution1D emitters_;
  double emitter_density_ = 0;  ///< chance of the emitters / sum of area * weight
};

/// World area of an emissive triangle.
double emitter_area(const Emitter& emitter);

/// Power heuristic with exponent 2 (Veach 1997, section 9.2.4): the weight of the strategy with density `a`.
inline float mis_weight(double a, double b) {
  const double ratio = b / a;
  return static_cast<float>(1 / (1 + ratio * ratio));
}

}  // namespace shoal
