// One light sample a vertex: which light, which point or direction on it, and with what density.
//
// Lights are emissive triangles, point and spot lights, directional lights, and an environment picture. The first three
// are **placed**: where there are more than kFewLights of them, they are one choice among the others, and a tree
// (engine/light_tree) says which of them, by what each may bring to the vertex. With fewer, all emissive triangles
// together are one choice and each point or spot light is one; among the triangles the chance is proportional to area *
// Material::emission_weight, so that their density is known from a material alone. With LightChoice::kPower it is so of
// any number. With kUniform each triangle, each punctual light and the environment have the same chance.
// Among these choices the chances are fixed, half by power and half evenly, so that neither a dim light nearby nor a
// bright one far away is starved. Powers: emitters 2 pi * area * luminance, point 4 pi I, spot 2 pi (1 - cos outer) I,
// directional pi R^2 E, environment 4 pi^2 R^2 * mean luminance (R: half the diagonal of the scene). The point on a
// triangle is uniform.
// Called by engine/shade. Immutable; a sample costs a binary search, and two or the way down the tree.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/environment.h"
#include "engine/light_choice.h"
#include "engine/light_tree.h"
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

/// The lights of a scene as they are shaded: fewer than it has where some are forced off.
struct LightSources {
  std::span<const Emitter> emitters;
  std::span<const PunctualLight> lights;
  std::span<const Material> materials;  ///< of the emitters
};

class LightSampler {
 public:
  /// So many placed lights have no tree: two triangles are one lamp, and two lamps gain less than a tree costs.
  static constexpr uint64_t kFewLights = 2;

  /// Keeps references to what it is given. `threads` build the tree, if there is to be one.
  LightSampler(const Scene& scene, const Environment& environment, unsigned threads = 1,
               LightChoice choice = LightChoice::kTree)
      : LightSampler(scene, {scene.emitters, scene.lights, scene.materials}, environment, threads, choice) {}
  LightSampler(const Scene& scene, const LightSources& sources, const Environment& environment, unsigned threads,
               LightChoice choice);

  bool empty() const { return !(choices_.total() > 0); }
  /// Light is chosen by where it arrives: without, the receiver that the others take does not matter.
  bool has_tree() const { return !tree_.empty(); }
  /// Requires: !empty(). Light is chosen for `receiver` and sampled from `position`, where it is at `time` of the
  /// shutter; chances are those of where lights that move are in the middle of it.
  LightSample sample(const Vec3& position, const LightReceiver& receiver, const LightRandom& random,
                     float time = 0.5f) const;

  /// Density by area with which sample() finds a point on the emissive triangle that was hit, of this material; 0 when it
  /// never does.
  double emitter_pdf(const Material& material, const Hit& hit, const LightReceiver& receiver, float time = 0.5f) const {
    if (has_tree() || uniform_) return found_emitter_pdf(hit, receiver, time);
    const double pdf = emitter_density_ * sampled_weight(material);
    return pdf > 0 && moves(hit.instance) ? pdf * shrinking(hit, time) : pdf;
  }
  /// Solid-angle density with which sample() finds a direction to the environment.
  double environment_pdf(const Vec3& direction) const;

  uint64_t resident_bytes() const;
  /// Of a scene with so many emissive triangles and punctual lights: at most what resident_bytes() will be, and what is
  /// needed beside it while it is made.
  struct Bytes {
    uint64_t resident = 0, making = 0;
  };
  static Bytes bytes_at_most(uint64_t emitters, uint64_t punctual);

 private:
  /// Emitters with coverage are found by chance only: a shadow ray ends before the emitter and so cannot ask whether
  /// the emitter is there.
  static double sampled_weight(const Material& material) {
    return material.coverage == CoverageMode::kOpaque ? material.emission_weight : 0.0f;
  }
  bool moves(uint32_t instance) const {
    const TopTree& tree = scene_->top_tree;
    return tree.moves() && instance < tree.instance_count() && tree.instance(instance).moves();
  }
  Emitter emitter_at(const Emitter& emitter, float time) const;
  const Emitter* find_emitter(const Hit& hit) const;
  double area_at(const Emitter& emitter, float time) const;
  double shrinking(const Hit& hit, float time) const;
  double weight_of(const Emitter& emitter) const;
  void weigh_choices();
  void plant_tree(unsigned threads);
  double placed_power() const;
  /// Calls use(light, strength, its index in the tree) for each placed light that gives any light.
  template <class Use>
  void each_placed(const Use& use) const;
  void weigh_emitters();
  LightSample sample_emitter(size_t index, const Vec3& position, double chance, const LightRandom& random,
                             float time) const;
  LightSample sample_punctual(const PunctualLight& light, const Vec3& position, double chance) const;
  LightSample sample_environment(double chance, const LightRandom& random) const;
  double found_emitter_pdf(const Hit& hit, const LightReceiver& receiver, float time) const;

  const Scene* scene_;
  LightSources sources_;
  const Environment* environment_;
  bool uniform_;                   ///< LightChoice::kUniform
  std::vector<uint32_t> singles_;  ///< indices of the punctual lights that are a choice each
  Distribution1D choices_;         ///< singles_, then the tree or the emitters as one, then the environment
  LightTree tree_;                 ///< emitters by their index, then punctual lights
  Distribution1D emitters_;        ///< without a tree; uniform: 1 each
  double emitter_density_ = 0;     ///< likewise: chance of the emitters / sum of area * weight
};

/// World area of an emissive triangle.
double emitter_area(const Emitter& emitter);

/// Power heuristic with exponent 2 (Veach 1997, section 9.2.4): the weight of the strategy with density `a`.
inline float mis_weight(double a, double b) {
  const double ratio = b / a;
  return static_cast<float>(1 / (1 + ratio * ratio));
}

}  // namespace shoal
