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
std::vector<std::string> material_names(const Scene& scene) {
  std::vector<std::string> names(scene.materials.size());
  const Json json = Json::parse(scene.names, nullptr, false);
  if (!json.is_object() || !json.contains("materials") || !json["materials"].is_array()) return names;
  const Json& list = json["materials"];
  for (size_t i = 0; i < names.size() && i < list.size(); ++i) {
    if (list[i].is_string()) names[i] = list[i].get<std::string>();
  }
  return names;
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
  const std::vector<std::string> names = material_names(scene);
  std::vector<EffectState> plan;
  const auto add = [&](std::string_view name, std::string_view extension, uint32_t bit, const auto& calls) {
    EffectState state{name, extension, bit, 0, {}, false, ((choice.off | choice.on) & bit) != 0};
    for (size_t i = 0; i < scene.materials.size(); ++i) {
      if (!calls(scene.materials[i])) continue;
      const std::string label = names[i].empty() ? fmt::format("materials[{}]", i) : names[i];
      if (state.materials_count++ == 0 || label < state.first_material) state.first_material = label;
    }
    const bool called = state.materials_count > 0;
    state.on = bit == 0 ? called : (choice.of(called ? bit : 0) & bit) != 0;
    plan.push_back(std::move(state));
  };
  add("reflection", "glTF 2.0", 0, reflects);
  add("emission", "glTF 2.0", 0, emits);
  add("coverage", "glTF 2.0", 0, covers_in_part);
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
    std::string why = "no material calls for it";
    if (e.materials_count > 0) {
      why = fmt::format("{} material{}, first \"{}\"", e.materials_count, e.materials_count == 1 ? "" : "s",
                        e.first_material);
    }
    if (e.forced) why += e.on ? "; forced on" : "; forced off";
    text += fmt::format("{:<22}{:<5}{}\n", e.name, e.on ? "on" : "off", why);
  }
  return text;
}

}  // namespace shoal
