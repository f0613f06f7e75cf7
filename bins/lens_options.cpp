#include "bins/lens_options.h"

#include <fmt/format.h>

#include <charconv>
#include <map>

#include "bins/choice_option.h"

namespace shoal {
namespace {

/// All of `text` as numbers between commas, at most `most`; false otherwise.
bool read_numbers(std::string_view text, size_t most, std::array<double, Distortion::kMaxCoefficients>& out) {
  for (size_t i = 0; i < most; ++i) {
    const auto [rest, code] = std::from_chars(text.data(), text.data() + text.size(), out[i]);
    if (code != std::errc()) return false;
    text.remove_prefix(static_cast<size_t>(rest - text.data()));
    if (text.empty()) return true;
    if (text.front() != ',') return false;
    text.remove_prefix(1);
  }
  return false;
}

/// CLI11 wants exceptions of its own from what reads an option.
void require(const Status& status, const char* flag) {
  if (!status.ok()) throw CLI::ValidationError(flag, status.error().message);
}

}  // namespace

Result<Distortion> parse_distortion(const std::string& text) {
  Distortion distortion;
  distortion.model = DistortionModel::kRadial;
  size_t most = Distortion::kMaxCoefficients;
  std::string_view numbers = text;
  if (text.starts_with("radial:")) numbers.remove_prefix(7);
  if (text.starts_with("brown:")) {
    numbers.remove_prefix(6);
    distortion.model = DistortionModel::kBrown;
    most = 5;
  }
  if (read_numbers(numbers, most, distortion.k)) return distortion;
  return Error{ErrorCode::kUsage, fmt::format("'{}' is no distortion: expected up to six numbers K1,K2,... or "
                                              "brown:K1,K2,K3,P1,P2", text)};
}

Status parse_aperture(const std::string& text, LensOptions& lens) {
  const bool stop = text.starts_with("f/");
  const char* begin = text.data() + (stop ? 2 : 0);
  const char* end = text.data() + text.size();
  float value = 0;
  const auto [rest, code] = std::from_chars(begin, end, value);
  if (code != std::errc() || rest != end || !(value >= 0) || (stop && value == 0)) {
    return Error{ErrorCode::kUsage, fmt::format("'{}' is no aperture: expected a diameter such as 0.02, or f/2.8", text)};
  }
  lens.aperture = stop ? 0 : value;
  lens.f_stop = stop ? value : 0;
  return {};
}

void declare_lens(CLI::App& app, PictureOptions& picture) {
  static const std::map<std::string, Projection> kProjections{{"perspective", Projection::kPerspective},
                                                               {"orthographic", Projection::kOrthographic},
                                                               {"equirectangular", Projection::kEquirectangular},
                                                               {"fisheye", Projection::kFisheye}};
  LensOptions& lens = picture.lens;
  const char* const group = "Camera";
  app.add_option("--camera", picture.camera, "index among the scene's cameras")->capture_default_str()->group(group);
  add_choice(app, "--projection", lens.projection, kProjections, " (default: the camera's)")
      ->type_name("WAY")
      ->group(group);
  app.add_option("--fov", lens.fov_degrees,
                 "degrees: perspective, from bottom to top (default: the camera's); fisheye, across (default 180)")
      ->group(group);
  app.add_option("--ortho-height", lens.height, "orthographic: height of the picture in the scene's units")->group(group);
  app.add_option_function<std::string>(
         "--aperture", [&lens](const std::string& text) { require(parse_aperture(text, lens), "--aperture"); },
         "of a thin lens: its diameter in the scene's units, or f/STOP of a picture 24 mm high (default: a pinhole)")
      ->type_name("DIAMETER|f/STOP")
      ->group(group);
  app.add_option("--focus", lens.focus_distance, "distance that is sharp, in the scene's units, along the view")
      ->group(group);
  app.add_option_function<std::string>(
         "--distortion",
         [&lens](const std::string& text) {
           auto distortion = parse_distortion(text);
           require(distortion.ok() ? Status() : Status(distortion.error()), "--distortion");
           lens.distortion = distortion.value();
         },
         "of a head-mounted display K1,K2,..., or of a calibrated camera brown:K1,K2,K3,P1,P2")
      ->type_name("K1,K2,...")
      ->group(group);
}

}  // namespace shoal
