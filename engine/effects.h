// The effects plan: every effect that a scene can call for, whether it does, how many of its materials, lights or
// instances do, which is the first by name; and the choice of a user to force an effect of materials off or on. What no material calls for is not
// looked up, not evaluated and has no table. Called by bins, engine/shade and engine/describe_scene.
// Forcing an effect on changes no bit of the picture: it runs with values that do nothing where a material does not
// call for it. Cost: one pass over the materials.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "engine/scene.h"

namespace shoal {

/// --effects: masks of MaterialEffects.
struct EffectChoice {
  uint32_t off = 0, on = 0;

  /// The effects that a material is shaded with.
  uint32_t of(uint32_t called) const { return (called & ~off) | on; }
};

/// "-clearcoat,+sheen", "all" (everything on), "-all"; from left to right. Fails with: kUsage (names the choices).
Result<EffectChoice> parse_effects(const std::string& text);
/// The same as text; empty when nothing is forced.
std::string effects_text(const EffectChoice& choice);

struct EffectState {
  std::string_view name;         ///< as --effects has it
  std::string_view extension;    ///< of glTF, or "glTF 2.0"
  uint32_t bit = 0;              ///< of MaterialEffects; 0: cannot be forced
  std::string_view caller;       ///< what calls for it: "material", "light", "instance"
  uint64_t callers_count = 0;
  std::string first_caller{};    ///< the first of these by name; empty where they have none
  bool on = false;               ///< simulated
  bool forced = false;
};

/// In a fixed order.
std::vector<EffectState> effects_plan(const Scene& scene, const EffectChoice& choice);
/// The effects (a mask) that shading tables are needed for.
uint32_t effects_called_for(const Scene& scene, const EffectChoice& choice);
/// A line an effect: name, on or off, and why.
std::string effects_plan_text(const std::vector<EffectState>& plan);
/// The same as a JSON array.
std::string effects_plan_json(const std::vector<EffectState>& plan);

}  // namespace shoal
