#include "engine/effects.h"

#include <fmt/format.h>

#include <array>
#include <nlohmann/json.hpp>

namespace shoal {
namespace {

using Json = nlohmann::json;

struct Effect {
  std::string_view name, extension;
  uint32_t bit;
};
constexpr std::array<Effect, 20> kForceable = {{
    {"reflection", "glTF 2.0", kEffectReflection},
    {"emission", "glTF 2.0", kEffectEmission},
    {"coverage", "glTF 2.0", kEffectCoverage},
    {"textures", "glTF 2.0", kEffectTextures},
    {"vertex-colors", "glTF 2.0", kEffectVertexColors},
    {"punctual-lights", "KHR_lights_punctual", kEffectPunctualLights},
    {"environment", "", kEffectEnvironment},
    {"lens", "", kEffectLens},
    {"motion", "glTF 2.0", kEffectMotion},
    {"normal-map", "glTF 2.0", kEffectNormalMap},
    {"texture-transform", "KHR_texture_transform", kEffectTextureTransform},
    {"unlit", "KHR_materials_unlit", kEffectUnlit},
    {"transmission", "KHR_materials_transmission", kEffectTransmission},
    {"volume", "KHR_materials_volume", kEffectVolume},
    {"dispersion", "KHR_materials_dispersion", kEffectDispersion},
    {"diffuse-transmission", "KHR_materials_diffuse_transmission", kEffectDiffuseTransmission},
    {"clearcoat", "KHR_materials_clearcoat", kEffectClearcoat},
    {"sheen", "KHR_materials_sheen", kEffectSheen},
    {"anisotropy", "KHR_materials_anisotropy", kEffectAnisotropy},
    {"iridescence", "KHR_materials_iridescence", kEffectIridescence},
}};

std::string known_names() {
  std::string names;
  for (const Effect& effect : kForceable) names += fmt::format("{}{}", names.empty() ? "" : ", ", effect.name);
  return names;
}

Status apply(std::string_view word, EffectChoice& choice) {
  const bool off = word.starts_with('-');
  const std::string_view name = off || word.starts_with('+') ? word.substr(1) : word;
  uint32_t bits = name == "all" ? kAllMaterialEffects | kAllSceneEffects : 0;
  for (const Effect& effect : kForceable) {
    if (effect.name == name) bits = effect.bit;
  }
  // A bare name would be as easily meant to be the only one that is on.
  if (bits == 0 || (name == word && name != "all")) {
    return Error{ErrorCode::kUsage,
                 fmt::format("'{}' is not an effect to force: expected all, -all, or + or - and one of {}", word,
                             known_names())};
  }
  choice.off = off ? choice.off | bits : choice.off & ~bits;
  choice.on = off ? choice.on & ~bits : choice.on | bits;
  return {};
}

/// Names from the file, for people; none where the file has none.
std::vector<std::string> names_of(const Scene& scene, const char* what, size_t count) {
  std::vector<std::string> names(count);
  const Json json = Json::parse(scene.names, nullptr, false);
  if (!json.is_object() || !json.contains(what) || !json[what].is_array()) return names;
  const Json& list = json[what];
  for (size_t i = 0; i < names.size() && i < list.size(); ++i) {
    if (list[i].is_string()) names[i] = list[i].get<std::string>();
  }
  return names;
}

/// One more that calls for an effect.
void count_caller(EffectState& state, const std::string& name, size_t index) {
  const std::string label = name.empty() ? fmt::format("{}s[{}]", state.caller, index) : name;
  if (state.callers_count++ == 0 || label < state.first_caller) state.first_caller = label;
}

/// Those that effects are called for by, with their names.
struct Callers {
  const Scene& scene;
  const EffectAskers& askers;
  std::vector<std::string> materials = names_of(scene, "materials", scene.materials.size());
  std::vector<std::string> lights = names_of(scene, "lights", scene.lights.size());
};

void count_materials(const Callers& callers, EffectState& state, const auto& calls) {
  const Scene& scene = callers.scene;
  const std::vector<std::string>& names = callers.materials;
  for (size_t i = 0; i < names.size(); ++i) {
    if (calls(scene.materials[i])) count_caller(state, names[i], i);
  }
}

void count_lights(const Callers& callers, EffectState& state) {
  state.caller = "light";
  for (size_t i = 0; i < callers.lights.size(); ++i) count_caller(state, callers.lights[i], i);
}

void count_option(std::string_view asker, EffectState& state) {
  state.caller = "option";
  if (!asker.empty()) count_caller(state, std::string(asker), 0);
}

EffectState called_by_instances(const Scene& scene) {
  EffectState state{"instance-transforms", "glTF 2.0", 0, "instance"};
  for (const Instance& instance : scene.top_tree.instances()) state.callers_count += instance.identity == 0 ? 1 : 0;
  state.on = state.callers_count > 0;
  return state;
}

/// What stands still is no caller, nor is anything where the shutter is not open.
void count_moving(const Scene& scene, EffectState& state) {
  state.caller = "node";
  for (const Instance& instance : scene.top_tree.instances()) state.callers_count += instance.moves() ? 1 : 0;
  for (const CameraRecord& camera : scene.cameras) state.callers_count += camera.key_count > 0 ? 1 : 0;
}

bool has_texture(const Scene& scene, const Material& m) {
  for (const TextureSlot* s : texture_slots(m)) {
    if (s->texture != kNoIndex) return true;
  }
  if ((m.effects & kLayerEffects) == 0) return false;
  for (const TextureSlot* s : texture_slots(scene.material_layers[m.layers])) {
    if (s->texture != kNoIndex) return true;
  }
  return false;
}

bool reflects(const Material& m) { return (m.effects & kEffectUnlit) == 0 && (m.metallic > 0 || m.specular > 0); }

void count_callers(const Callers& callers, EffectState& state) {
  const auto flagged = [](uint32_t flag) { return [flag](const Material& m) { return (m.flags & flag) != 0; }; };
  switch (state.bit) {
    case kEffectReflection: return count_materials(callers, state, reflects);
    case kEffectEmission: return count_materials(callers, state, flagged(kMaterialEmits));
    case kEffectCoverage:
      return count_materials(callers, state, [](const Material& m) { return m.coverage != CoverageMode::kOpaque; });
    case kEffectTextures:
      return count_materials(callers, state, [&](const Material& m) { return has_texture(callers.scene, m); });
    case kEffectVertexColors: return count_materials(callers, state, flagged(kMaterialVertexColors));
    case kEffectPunctualLights: return count_lights(callers, state);
    case kEffectEnvironment: return count_option(callers.askers.environment, state);
    case kEffectLens: return count_option(callers.askers.lens, state);
    case kEffectMotion: return count_moving(callers.scene, state);
    default:
      return count_materials(callers, state, [&](const Material& m) { return (m.effects & state.bit) != 0; });
  }
}

/// Why an effect is on or off, for people.
std::string reason(const EffectState& e) {
  std::string why;
  if (e.caller == "option") {
    const std::string_view who = e.bit == kEffectLens ? "--aperture or --distortion" : "--environment";
    why = e.callers_count > 0 ? fmt::format("{} asks for it", e.first_caller)
                              : fmt::format("no option asks for it: {} would", who);
  } else if (e.bit == kEffectMotion) {
    why = e.callers_count > 0 ? fmt::format("{} node{} while the shutter is open", e.callers_count,
                                            e.callers_count == 1 ? " moves" : "s move")
                              : "no node moves while the shutter is open (--shutter of the build)";
  } else if (e.callers_count == 0) {
    why = fmt::format("no {} calls for it", e.caller);
  } else {
    why = fmt::format("{} {}{}", e.callers_count, e.caller, e.callers_count == 1 ? "" : "s");
    if (!e.first_caller.empty()) why += fmt::format(", first \"{}\"", e.first_caller);
  }
  if (e.forced) why += e.on ? "; forced on" : "; forced off";
  if (e.bit == 0) why += "; cannot be forced";
  return why;
}

}  // namespace

Result<EffectChoice> parse_effects(const std::string& text) {
  EffectChoice choice;
  for (size_t at = 0; at < text.size();) {
    const size_t comma = std::min(text.find(',', at), text.size());
    SHOAL_RETURN_IF_ERROR(apply(std::string_view(text).substr(at, comma - at), choice));
    at = comma + 1;
  }
  return choice;
}

std::string effects_text(const EffectChoice& choice) {
  std::string text;
  for (const Effect& effect : kForceable) {
    const bool off = (choice.off & effect.bit) != 0;
    if (!off && (choice.on & effect.bit) == 0) continue;
    text += fmt::format("{}{}{}", text.empty() ? "" : ",", off ? '-' : '+', effect.name);
  }
  return text;
}

std::vector<EffectState> effects_plan(const Scene& scene, const EffectChoice& choice, const EffectAskers& askers) {
  const Callers callers{scene, askers};
  std::vector<EffectState> plan;
  for (const Effect& effect : kForceable) {
    EffectState state{effect.name, effect.extension, effect.bit, "material"};
    count_callers(callers, state);
    state.on = (choice.of(state.callers_count > 0 ? effect.bit : 0) & effect.bit) != 0;
    state.forced = ((choice.off | choice.on) & effect.bit) != 0;
    plan.push_back(std::move(state));
  }
  plan.push_back(called_by_instances(scene));
  return plan;
}

uint32_t effects_called_for(const Scene& scene, const EffectChoice& choice) {
  uint32_t called = 0;
  for (const Material& material : scene.materials) called |= choice.of(material.effects);
  return called;
}

std::string effects_plan_text(const std::vector<EffectState>& plan) {
  std::string text;
  for (const EffectState& e : plan) text += fmt::format("{:<22}{:<5}{}\n", e.name, e.on ? "on" : "off", reason(e));
  return text;
}

std::string effects_plan_json(const std::vector<EffectState>& plan) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const EffectState& e : plan) {
    list.push_back({{"name", e.name},
                    {"extension", e.extension},
                    {"on", e.on},
                    {"forced", e.forced},
                    {"can_be_forced", e.bit != 0},
                    {"called_for_by", e.caller},
                    {"callers_count", e.callers_count},
                    {"first_caller", e.first_caller}});
  }
  return list.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace shoal
