// The knobs that trade accuracy for time and have a few named values: one list each makes the options, --stats and the
// attributes of pictures. Called by bins, engine/render_report and tests. Plain constants.
#pragma once

#include <string_view>

#include "engine/light_choice.h"
#include "engine/sampler.h"
#include "engine/texture_footprint.h"
#include "treelets/triangle_test_kind.h"

namespace shoal {

template <class T>
struct NamedValue {
  std::string_view name;
  T value;
};

inline constexpr NamedValue<SamplerKind> kSamplers[] = {
    {"independent", SamplerKind::kIndependent}, {"sobol", SamplerKind::kSobol}, {"blue-noise", SamplerKind::kBlueNoise}};
inline constexpr NamedValue<LightChoice> kLightChoices[] = {
    {"tree", LightChoice::kTree}, {"power", LightChoice::kPower}, {"uniform", LightChoice::kUniform}};
inline constexpr NamedValue<TextureFilter> kTextureFilters[] = {{"mip", TextureFilter::kMip},
                                                                {"bilinear", TextureFilter::kBilinear}};

inline constexpr NamedValue<TriangleTest> kTriangleTests[] = {
    {"fast", TriangleTest::kFast}, {"watertight", TriangleTest::kWatertight}, {"double", TriangleTest::kDouble}};

/// The name of a value in such a list; empty: it has none.
template <class T, size_t N>
constexpr std::string_view name_in(const NamedValue<T> (&list)[N], T value) {
  for (const NamedValue<T>& named : list) {
    if (named.value == value) return named.name;
  }
  return {};
}

inline constexpr std::string_view sampler_name(SamplerKind kind) { return name_in(kSamplers, kind); }
inline constexpr std::string_view light_choice_name(LightChoice choice) { return name_in(kLightChoices, choice); }
inline constexpr std::string_view texture_filter_name(TextureFilter filter) { return name_in(kTextureFilters, filter); }

}  // namespace shoal
