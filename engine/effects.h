// The effects plan: every effect that a scene or a picture can call for, whether it does, how many of the scene's
// materials, lights or instances do, which is the first by name; and the choice of a user to force an effect off or on.
// What nothing calls for is not looked up, not evaluated and has no table. Called by bins, engine/shade and
// engine/describe_scene.
// Forcing an effect on changes no bit of the picture: it runs with values that do nothing where nothing calls for it.
// Cost: one pass over the materials.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "engine/scene.h"

namespace shoal {

/// Effects of whole scenes and pictures, in bits above MaterialEffects; never in Material::effects.
enum SceneEffects : uint32_t {
  kEffectReflection = 1u << 16,      ///< the specular lobe of metallic-roughness; off: metallic and specular are 0
  kEffectEmission = 1u << 17,
  kEffectCoverage = 1u << 18,        ///< off: alpha MASK and BLEND are opaque
  kEffectTextures = 1u << 19,        ///< but those of coverage, which are part of the geometry
  kEffectVertexColors = 1u << 20,
  kEffectPunctualLights = 1u << 21,
  kEffectEnvironment = 1u << 22,
  kEffectLens = 1u << 23,            ///< aperture and distortion
  kEffectMotion = 1u << 24,          ///< off: all stands as in the middle of the shutter
};
inline constexpr uint32_t kAllSceneEffects = 0x1ff0000;
/// Those that a material's values are changed for.
inline constexpr uint32_t kMaterialSceneEffects =
    kEffectReflection | kEffectEmission | kEffectCoverage | kEffectTextures;

/// --effects: masks of MaterialEffects and SceneEffects.
struct EffectChoice {
  uint32_t off = 0, on = 0;

  /// The effects that a material is shaded with.
  uint32_t of(uint32_t called) const { return (called & ~off) | on; }
};

/// What asks for the effects that belong to the picture, not to the scene; empty: nothing does.
struct EffectAskers {
  std::string_view environment, lens;
};

/// "-clearcoat,+sheen", "all" (everything on), "-all"; from left to right. Fails with: kUsage (names the choices).
Result<EffectChoice> parse_effects(const std::string& text);
/// The same as text; empty when nothing is forced.
std::string effects_text(const EffectChoice& choice);

struct EffectState {
  std::string_view name;         ///< as --effects has it
  std::string_view extension;    ///< of glTF, or "glTF 2.0"
  uint32_t bit = 0;              ///< of MaterialEffects or SceneEffects; 0: cannot be forced
  std::string_view caller;       ///< what calls for it: "material", "light", "node", "instance", "option"
  uint64_t callers_count = 0;
  std::string first_caller{};    ///< the first of these by name; empty where they have none
  bool on = false;               ///< simulated
  bool forced = false;
};

/// In a fixed order.
std::vector<EffectState> effects_plan(const Scene& scene, const EffectChoice& choice, const EffectAskers& askers = {});
/// The effects (a mask) that shading tables are needed for.
uint32_t effects_called_for(const Scene& scene, const EffectChoice& choice);
/// A line an effect: name, on or off, and why.
std::string effects_plan_text(const std::vector<EffectState>& plan);
/// The same as a JSON array.
std::string effects_plan_json(const std::vector<EffectState>& plan);

}  // namespace shoal
