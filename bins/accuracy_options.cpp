#include "bins/accuracy_options.h"

#include <fmt/format.h>

#include <charconv>

#include "bins/choice_option.h"
#include "engine/accuracy_names.h"

namespace shoal {
namespace {

uint32_t parse_roulette(const std::string& text) {
  if (text == "off") return ShadingOptions::kNoRoulette;
  uint32_t start = 0;
  const char* end = text.data() + text.size();
  const auto [rest, code] = std::from_chars(text.data(), end, start);
  if (code != std::errc() || rest != end) {
    throw CLI::ValidationError("--roulette-start", "expected a number of bounces or off, found '" + text + "'");
  }
  return start;
}

}  // namespace

void declare_accuracy(CLI::App& app, PictureOptions& picture) {
  ShadingOptions& shading = picture.shading;
  const char* const group = "Accuracy";
  app.add_option("--spp", picture.samples, "samples a pixel")->capture_default_str()->group(group);
  add_choice(app, "--sampler", shading.sampler, choices_of(kSamplers), ": how samples are spread (docs/sampling.md)")
      ->type_name("WAY")
      ->group(group);
  app.add_option("--bounces", shading.bounces, "scattering events of a path at most")
      ->capture_default_str()
      ->group(group);
  app.add_option_function<std::string>(
         "--roulette-start", [&shading](const std::string& text) { shading.roulette_start = parse_roulette(text); },
         "first bounce at which Russian roulette may end a path, or off: never (default 3)")
      ->type_name("N|off")
      ->group(group);
  const char* const limit = "most of one contribution in its largest channel, of light scattered";
  app.add_option("--clamp-direct", shading.clamp_direct, fmt::format("{} once; 0: no limit", limit))
      ->capture_default_str()
      ->group(group);
  app.add_option("--clamp-indirect", shading.clamp_indirect, fmt::format("{} more often; 0: no limit", limit))
      ->capture_default_str()
      ->group(group);
  add_choice(app, "--light-choice", shading.light_choice, choices_of(kLightChoices),
             ": by what one of many lights is chosen")
      ->type_name("WAY")
      ->group(group);
  add_choice(app, "--texture-filter", shading.texture_filter, choices_of(kTextureFilters),
             ": textures by the width of the ray (default), or always at their finest")
      ->type_name("WAY")
      ->group(group);
  add_choice(app, "--triangle-test", shading.triangle_test, choices_of(kTriangleTests),
             ": all in float, which may let light through where triangles meet; with exact signs (default); sheared in "
             "double as well")
      ->type_name("WAY")
      ->group(group);
  app.add_option("--seed", shading.seed, "of the random numbers")->capture_default_str();
}

}  // namespace shoal
