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
constexpr std::array<Effect, 11> kForceable = {{
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
  uint32_t bits = name == "all" ? kAllMaterialEffects : 0;
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

EffectState called_by_lights(const Scene& scene) {
  EffectState state{"punctual-lights", "KHR_lights_punctual", 0, "light"};
  const std::vector<std::string> names = names_of(scene, "lights", scene.lights.size());
  for (size_t i = 0; i < names.size(); ++i) count_caller(state, names[i], i);
  state.on = state.callers_count > 0;
  return state;
}

EffectState called_by_instances(const Scene& scene) {
  EffectState state{"instance-transforms", "glTF 2.0", 0, "instance"};
  for (const Instance& instance : scene.top_tree.instances()) state.callers_count += instance.identity == 0 ? 1 : 0;
  state.on = state.callers_count > 0;
  return state;
}

bool has_texture(const Scene& scene, const Material& m) {
  for (const TextureSlot& s : {m.base_color_texture, m.metallic_roughness_texture, m.normal_texture,
                               m.emissive_texture, m.specular_texture, m.specular_color_texture}) {
    if (s.texture != kNoIndex) return true;
  }
  if ((m.effects & kLayerEffects) == 0) return false;
  for (const TextureSlot& s : texture_slots(scene.material_layers[m.layers])) {
    if (s.texture != kNoIndex) return true;
  }
  return false;
}

bool emits(const Material& m) { return (m.flags & kMaterialEmits) != 0; }
bool covers_in_part(const Material& m) { return m.coverage != CoverageMode::kOpaque; }
bool reflects(const Material& m) { return (m.effects & kEffectUnlit) == 0 && (m.metallic > 0 || m.specular > 0); }

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

std::vector<EffectState> effects_plan(const Scene& scene, const EffectChoice& choice) {
  const std::vector<std::string> names = names_of(scene, "materials", scene.materials.size());
  std::vector<EffectState> plan;
  const auto add = [&](std::string_view name, std::string_view extension, uint32_t bit, const auto& calls) {
    EffectState state{name, extension, bit, "material"};
    for (size_t i = 0; i < scene.materials.size(); ++i) {
      if (calls(scene.materials[i])) count_caller(state, names[i], i);
    }
    const bool called = state.callers_count > 0;
    state.on = bit == 0 ? called : (choice.of(called ? bit : 0) & bit) != 0;
    state.forced = ((choice.off | choice.on) & bit) != 0;
    plan.push_back(std::move(state));
  };
  add("reflection", "glTF 2.0", 0, reflects);
  add("emission", "glTF 2.0", 0, emits);
  add("coverage", "glTF 2.0", 0, covers_in_part);
  add("textures", "glTF 2.0", 0, [&](const Material& m) { return has_texture(scene, m); });
  plan.push_back(called_by_lights(scene));
  plan.push_back(called_by_instances(scene));
  for (const Effect& effect : kForceable) {
    add(effect.name, effect.extension, effect.bit, [&](const Material& m) { return (m.effects & effect.bit) != 0; });
  }
  return plan;
}

uint32_t effects_called_for(const Scene& scene, const EffectChoice& choice) {
  uint32_t called = 0;
  for (const Material& material : scene.materials) called |= choice.of(material.effects);
  return called;
}

std::string effects_plan_text(const std::vector<EffectState>& plan) {
  std::string text;
  for (const EffectState& e : plan) {
    std::string why = fmt::format("no {} calls for it", e.caller);
    if (e.callers_count > 0) why = fmt::format("{} {}{}", e.callers_count, e.caller, e.callers_count == 1 ? "" : "s");
    if (!e.first_caller.empty()) why += fmt::format(", first \"{}\"", e.first_caller);
    if (e.forced) why += e.on ? "; forced on" : "; forced off";
    text += fmt::format("{:<22}{:<5}{}\n", e.name, e.on ? "on" : "off", why);
  }
  return text;
}

std::string effects_plan_json(const std::vector<EffectState>& plan) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const EffectState& e : plan) {
    list.push_back({{"name", e.name},
                    {"extension", e.extension},
                    {"on", e.on},
                    {"forced", e.forced},
                    {"called_for_by", e.caller},
                    {"callers_count", e.callers_count},
                    {"first_caller", e.first_caller}});
  }
  return list.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace shoal
