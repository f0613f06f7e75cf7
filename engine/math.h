// The few transcendental functions that a picture depends on, each implemented once from IEEE + - * / sqrt only:
// libm picks its code by the processor, so its bits may differ between machines. Computed in double, rounded once;
// accuracy is stated here and swept in tests/engine. Called by camera, shading and film. Pure; 5 to 40 ns a call.
#pragma once

namespace shoal {

inline constexpr float kPi = 3.14159265358979323846f;

struct SinCos {
  float sin, cos;
};
/// Absolute error below 2^-23 for |x| <= 2^15 (Cody-Waite reduction, Taylor polynomials); (0, 1) beyond 2^20.
SinCos sin_cos(float x);
/// Absolute error below 2^-21 rad; arc_tangent(0, 0) = 0. Requires: finite arguments.
float arc_tangent(float y, float x);
/// Absolute error below 2^-21 rad; the argument is clamped to [-1, 1].
float arc_cosine(float x);
/// sRGB transfer functions of IEC 61966-2-1, continued above 1; relative error below 2^-22. Negative values take
/// the linear part.
float srgb_to_linear(float encoded);
float linear_to_srgb(float linear);
/// log2 of a positive number, relative error below 2^-20 or absolute below 2^-20. Requires: x > 0, finite.
float log2_of(float x);
/// 2^x, relative error below 2^-22; 0 below -126, 2^127 above 127.
float exp2_of(float x);
/// x^y for x >= 0, relative error below 2^-18 for results above 2^-100; 0 for x = 0.
float power_of(float x, float y);
/// x^5 by multiplication (Schlick).
inline float power5(float x) { return (x * x) * (x * x) * x; }

}  // namespace shoal
