// From linear radiance to 8-bit sRGB for PNG: exposure, a tone curve, the sRGB encoding. Called by bins
// and engine/preview. Plain functions, any thread; bits do not depend on the machine (engine/math.h). Cost: about 50 ns
// a pixel.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "io/result.h"
#include "treelets/vector.h"

namespace shoal {

enum class ToneCurve : uint8_t {
  kPbrNeutral,  ///< Khronos PBR Neutral: base colours below 0.8 keep their hue, highlights are compressed
  kNone,        ///< values are clipped to [0, 1]
};

struct ToneMapOptions {
  ToneCurve curve = ToneCurve::kPbrNeutral;
  float exposure_stops = 0;  ///< radiance is multiplied by 2^exposure_stops
};

/// `pbr-neutral` or `none`, as --tonemap takes them. Fails with: kUsage.
Result<ToneCurve> parse_tone_curve(const std::string& name);

/// Khronos PBR Neutral Tone Mapper (specification 1.0, Khronos Group 2024), linear sRGB primaries in and out, [0,
/// 1]. Requires: finite components, none negative.
Vec3 pbr_neutral(const Vec3& color);

/// 2^stops from + - * / only; relative error below 2^-40. `stops` is clamped to [-100, 100].
double exposure_scale(float stops);

/// One pixel: components that are not finite or negative count as 0 (positive infinity as the largest float).
Vec3 tone_map(const Vec3& radiance, const ToneMapOptions& options);

/// A picture in three planes to interleaved 8-bit sRGB. Requires: planes of one size.
std::vector<uint8_t> tone_map_image(std::span<const float> red, std::span<const float> green,
                                    std::span<const float> blue, const ToneMapOptions& options);

}  // namespace shoal
