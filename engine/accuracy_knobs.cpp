#include "engine/accuracy_knobs.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <utility>

#include "engine/accuracy_names.h"

namespace shoal {
namespace {

constexpr uint32_t kNever = ShadingOptions::kNoRoulette;

/// A knob over one member: `place` finds it in settings.
template <class Place, class Value>
std::vector<KnobValue> values_at(Place place, std::vector<std::pair<std::string, Value>> named) {
  std::vector<KnobValue> values;
  for (auto& [name, value] : named) {
    values.push_back({name, [place, v = value](AccuracySettings& s) { place(s) = v; },
                      [place, v = value](const AccuracySettings& s) { return place(s) == v; }});
  }
  return values;
}

/// The same for numbers, which name themselves.
template <class Place>
std::vector<KnobValue> numbers_at(Place place, const std::set<uint32_t>& numbers) {
  std::vector<std::pair<std::string, uint32_t>> named;
  for (const uint32_t number : numbers) named.emplace_back(number == kNever ? "off" : std::to_string(number), number);
  return values_at(place, std::move(named));
}

/// A sixteenth of the base's samples to four times as many, by powers of two.
AccuracyKnob samples_knob(const AccuracySettings& base) {
  const uint32_t own = base.picture.samples;
  std::set<uint32_t> counts = {own};
  for (uint32_t n = 1; n <= 4 * own && n <= (1u << 22); n *= 2) {
    if (n >= own / 16) counts.insert(n);
  }
  return {kSamplesKnob, "--spp", "Paths traced for a pixel. Their noise goes down with their number, and their time up with it.",
          false, false, numbers_at([](auto& s) -> auto& { return s.picture.samples; }, counts)};
}

AccuracyKnob bounces_knob(const AccuracySettings& base) {
  constexpr uint32_t kTruth = 32;
  const uint32_t own = base.picture.shading.bounces;
  return {"bounces", "--bounces",
          "How often light may be scattered on its way to the eye. Fewer is faster, and leaves out the light that comes "
          "after.",
          true, false,
          numbers_at([](auto& s) -> auto& { return s.picture.shading.bounces; },
                     {1, 2, 4, 8, own, std::max(own, kTruth)})};
}

AccuracyKnob roulette_knob(const AccuracySettings& base) {
  return {"roulette", "--roulette-start",
          "The bounce from which chance may end a path that carries little light; those that go on count for more, so that "
          "the mean stays right. Sooner is faster, and noisier.",
          false, false,
          numbers_at([](auto& s) -> auto& { return s.picture.shading.roulette_start; },
                     {1, 3, kNever, base.picture.shading.roulette_start})};
}

AccuracyKnob texture_filter_knob() {
  return {"texture-filter", "--texture-filter",
          "Textures are read at the level of detail that a ray's width calls for, or always at the finest.", true, false,
          values_at([](auto& s) -> auto& { return s.picture.shading.texture_filter; },
                    std::vector<std::pair<std::string, TextureFilter>>{{"mip", TextureFilter::kMip},
                                                                      {"bilinear", TextureFilter::kBilinear}})};
}

AccuracyKnob light_choice_knob() {
  return {"light-choice", "--light-choice",
          "How one of many lights is drawn: all alike, by power alone, or by what each may bring to the place that is lit.", false,
          false,
          values_at([](auto& s) -> auto& { return s.picture.shading.light_choice; },
                    std::vector<std::pair<std::string, LightChoice>>{{"uniform", LightChoice::kUniform},
                                                                    {"power", LightChoice::kPower},
                                                                    {"tree", LightChoice::kTree}})};
}

AccuracyKnob triangle_test_knob() {
  return {"triangle-test", "--triangle-test",
          "By which arithmetic rays meet triangles: float, where light may pass between two; exact signs; double as well.",
          true, false,
          values_at([](auto& s) -> auto& { return s.picture.shading.triangle_test; },
                    std::vector<std::pair<std::string, TriangleTest>>{{"fast", TriangleTest::kFast},
                                                                     {"watertight", TriangleTest::kWatertight},
                                                                     {"double", TriangleTest::kDouble}})};
}

AccuracyKnob positions_knob() {
  std::vector<std::pair<std::string, PositionPrecision>> named;
  for (const PositionPrecision p : {PositionPrecision::k16, PositionPrecision::k21, PositionPrecision::kExact}) {
    named.emplace_back(position_precision_name(p), p);
  }
  return {"positions", "--positions",
          "Bits of a vertex's position along its object's longest side. Fewer make a smaller file of fewer treelets, and "
          "move surfaces by a known distance at most.",
          true, true, values_at([](auto& s) -> auto& { return s.build.positions; }, std::move(named))};
}

AccuracyKnob sampler_knob() {
  std::vector<std::pair<std::string, SamplerKind>> kinds;
  for (const auto& [name, kind] : kSamplers) kinds.emplace_back(name, kind);
  return {"sampler", "--sampler",
          "How the samples of a pixel are spread: at random, evenly, or evenly with the neighbours' so that errors are fine "
          "grained.",
          false, false, values_at([](auto& s) -> auto& { return s.picture.shading.sampler; }, std::move(kinds))};
}

/// Limits of `place`, the lowest first, and none at last.
template <class Place>
std::vector<KnobValue> limits_at(Place place, std::set<float> limits) {
  limits.erase(0);
  std::vector<std::pair<std::string, float>> named;
  for (const float limit : limits) named.emplace_back(fmt::format("{}", limit), limit);
  named.emplace_back("off", 0.0f);
  return values_at(place, std::move(named));
}

AccuracyKnob clamp_direct_knob(const AccuracySettings& base) {
  return {"clamp-direct", "--clamp-direct",
          "The most that light scattered once may add to a sample. A limit takes the brightest specks away, and the light "
          "that they stand for.",
          true, false,
          limits_at([](auto& s) -> auto& { return s.picture.shading.clamp_direct; },
                    {10, base.picture.shading.clamp_direct})};
}

AccuracyKnob clamp_indirect_knob(const AccuracySettings& base) {
  return {"clamp-indirect", "--clamp-indirect",
          "The same of light scattered more than once: less noise from rare bright ways, and darker where they matter.", true,
          false,
          limits_at([](auto& s) -> auto& { return s.picture.shading.clamp_indirect; },
                    {1, 10, base.picture.shading.clamp_indirect})};
}

}  // namespace

size_t AccuracyKnob::value_of(const AccuracySettings& settings) const {
  for (size_t i = 0; i < values.size(); ++i) {
    if (values[i].holds(settings)) return i;
  }
  return kNoValue;
}

std::vector<AccuracyKnob> accuracy_knobs(const AccuracySettings& base) {
  return {samples_knob(base),     sampler_knob(),      bounces_knob(base),   roulette_knob(base),
          texture_filter_knob(), light_choice_knob(), clamp_direct_knob(base), clamp_indirect_knob(base),
          triangle_test_knob(), positions_knob()};
}

Result<std::vector<AccuracyKnob>> choose_knobs(std::vector<AccuracyKnob> knobs, const std::vector<std::string>& names) {
  if (names.empty()) return knobs;
  std::string known;
  for (const AccuracyKnob& knob : knobs) known += (known.empty() ? "" : ", ") + knob.name;
  for (const std::string& name : names) {
    if (std::none_of(knobs.begin(), knobs.end(), [&](const AccuracyKnob& knob) { return knob.name == name; })) {
      return Error{ErrorCode::kUsage, fmt::format("unknown knob '{}': expected one of {}", name, known)};
    }
  }
  std::erase_if(knobs, [&](const AccuracyKnob& knob) {
    return std::find(names.begin(), names.end(), knob.name) == names.end();
  });
  return knobs;
}

void set_truth(const std::vector<AccuracyKnob>& knobs, AccuracySettings& settings) {
  for (const AccuracyKnob& knob : knobs) {
    if (knob.biases && !knob.values.empty()) knob.values.back().apply(settings);
  }
}

}  // namespace shoal
