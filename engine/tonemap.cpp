#include "engine/tonemap.h"

#include <fmt/format.h>

#include <cmath>

#include "engine/math.h"

namespace shoal {

Result<ToneCurve> parse_tone_curve(const std::string& name) {
  if (name == "pbr-neutral") return ToneCurve::kPbrNeutral;
  if (name == "none") return ToneCurve::kNone;
  return Error{ErrorCode::kUsage, fmt::format("tone mapping: expected pbr-neutral or none, found \"{}\"", name)};
}

Vec3 pbr_neutral(const Vec3& color) {
  // The constants of the specification: F90 compression starts at 0.8 - F0, F0 = 0.04 is a dielectric's
  // reflectance.
  constexpr float kReflectance = 0.04f;
  constexpr float kStartCompression = 0.8f - kReflectance;
  constexpr float kDesaturation = 0.15f;

  const float lowest = std::min(color.x, std::min(color.y, color.z));
  const float offset = lowest < 2 * kReflectance ? lowest - lowest * lowest / (4 * kReflectance) : kReflectance;
  const Vec3 diffuse = color - Vec3(offset);
  const float peak = std::max(diffuse.x, std::max(diffuse.y, diffuse.z));
  if (peak < kStartCompression) return diffuse;

  constexpr float kRange = 1 - kStartCompression;
  const float new_peak = 1 - kRange * kRange / (peak + kRange - kStartCompression);
  const Vec3 compressed = diffuse * (new_peak / peak);
  const float white = 1 - 1 / (kDesaturation * (peak - new_peak) + 1);
  return compressed * (1 - white) + Vec3(new_peak * white);
}

double exposure_scale(float stops) {
  if (!(stops > -100.0f)) stops = -100.0f;
  if (stops > 100.0f) stops = 100.0f;
  const int whole = static_cast<int>(stops + (stops < 0 ? -0.5f : 0.5f));
  // 2^f = e^(f ln 2), |f| <= 1/2: the Taylor series' 13th term is below 2^-48.
  const double x = (static_cast<double>(stops) - whole) * 0.69314718055994530942;
  double sum = 1, term = 1;
  for (int n = 1; n <= 13; ++n) {
    term = term * x / n;
    sum += term;
  }
  double scale = 1;
  for (int n = 0; n < (whole < 0 ? -whole : whole); ++n) scale = scale * 2;
  return whole < 0 ? sum / scale : sum * scale;
}

namespace {

float usable(double value) {
  constexpr double kLargest = std::numeric_limits<float>::max();
  if (!(value > 0)) return 0.0f;  // negative and not a number
  return static_cast<float>(value < kLargest ? value : kLargest);
}

Vec3 tone_map_scaled(const Vec3& radiance, ToneCurve curve, double scale) {
  const Vec3 exposed(usable(radiance.x * scale), usable(radiance.y * scale), usable(radiance.z * scale));
  const Vec3 mapped = curve == ToneCurve::kPbrNeutral ? pbr_neutral(exposed) : exposed;
  return glm::clamp(mapped, Vec3(0), Vec3(1));
}

uint8_t encode(float linear) { return static_cast<uint8_t>(linear_to_srgb(linear) * 255.0f + 0.5f); }

}  // namespace

Vec3 tone_map(const Vec3& radiance, const ToneMapOptions& options) {
  return tone_map_scaled(radiance, options.curve, exposure_scale(options.exposure_stops));
}

std::vector<uint8_t> tone_map_image(std::span<const float> red, std::span<const float> green,
                                    std::span<const float> blue, const ToneMapOptions& options) {
  SHOAL_CHECK(red.size() == green.size() && red.size() == blue.size());
  const double scale = exposure_scale(options.exposure_stops);
  std::vector<uint8_t> bytes(red.size() * 3);
  for (size_t i = 0; i < red.size(); ++i) {
    const Vec3 mapped = tone_map_scaled(Vec3(red[i], green[i], blue[i]), options.curve, scale);
    for (int c = 0; c < 3; ++c) bytes[i * 3 + c] = encode(mapped[c]);
  }
  return bytes;
}

}  // namespace shoal
