#include "engine/thin_film.h"

#include <algorithm>
#include <cmath>

#include "engine/math.h"

namespace shoal {
namespace {

constexpr float kLog2E = 1.44269504088896340736f;

float schlick(float f0, float cosine) { return f0 + (1 - f0) * power5(std::clamp(1 - cosine, 0.0f, 1.0f)); }
float normal_reflectance(float n_transmitted, float n_incident) {
  const float r = (n_transmitted - n_incident) / (n_transmitted + n_incident);
  return r * r;
}

/// Belcour & Barla 2017, eq. 11: the spectral sensitivities of the CIE 1931 observer as Gaussians, Fourier
/// transformed; the constants are those of their supplemental code, which the extension repeats. Then linear Rec. 709.
Vec3 sensitivity(float path_nm, const Vec3& shift) {
  const float phase = 2 * kPi * path_nm * 1e-9f;
  const auto gaussian = [phase](float value, float position, float variance, float phi) {
    return value * std::sqrt(2 * kPi * variance) * sin_cos(position * phase + phi).cos *
           exp2_of(-phase * phase * variance * kLog2E);
  };
  Vec3 xyz(gaussian(5.4856e-13f, 1.6810e+06f, 4.3278e+09f, shift.x) +
               gaussian(9.7470e-14f, 2.2399e+06f, 4.5282e+09f, shift.x),
           gaussian(4.4201e-13f, 1.7953e+06f, 9.3046e+09f, shift.y),
           gaussian(5.2481e-13f, 2.2084e+06f, 6.6121e+09f, shift.z));
  xyz /= 1.0685e-7f;
  return {3.2404542f * xyz.x - 1.5371385f * xyz.y - 0.4985314f * xyz.z,
          -0.9692660f * xyz.x + 1.8760108f * xyz.y + 0.0415560f * xyz.z,
          0.0556434f * xyz.x - 0.2040259f * xyz.y + 1.0572252f * xyz.z};
}

}  // namespace

Vec3 thin_film_reflectance(float cosine, float film_ior, float thickness_nm, const Vec3& base_f0) {
  // A film that vanishes has no index of its own: faded out over its first 0.03 nm, far below any interference.
  const float s = std::clamp(thickness_nm / 0.03f, 0.0f, 1.0f), fade = s * s * (3 - 2 * s);
  const float ior = 1 + fade * (film_ior - 1);
  const float sine2 = (1 - cosine * cosine) / (ior * ior);
  const float inner = std::sqrt(std::max(0.0f, 1 - sine2));  // no total reflection: ior >= 1
  const float r12 = schlick(normal_reflectance(ior, 1), cosine), t121 = 1 - r12;
  const float path = 2 * ior * thickness_nm * inner;  // Belcour & Barla 2017, eq. 3

  Vec3 r23(0), phi(0);
  for (int c = 0; c < 3; ++c) {
    const float root = std::sqrt(std::clamp(base_f0[c] + 0.0001f, 0.0f, 0.9999f));
    const float base_ior = (1 + root) / (1 - root);
    r23[c] = schlick(normal_reflectance(base_ior, ior), inner);
    phi[c] = kPi + (base_ior < ior ? kPi : 0.0f);  // entering the denser film from air: phi12 = 0, phi21 = pi
  }
  const Vec3 r123 = glm::clamp(r12 * r23, 1e-5f, 0.9999f), root123 = glm::sqrt(r123);
  const Vec3 rs = t121 * t121 * r23 / (1.0f - r123);
  Vec3 sum = r12 + rs, cm = rs - t121;  // eq. 10: the constant term, then pairs of orders
  for (int m = 1; m <= 2; ++m) {
    cm *= root123;
    sum += cm * 2.0f * sensitivity(static_cast<float>(m) * path, static_cast<float>(m) * phi);
  }
  return glm::clamp(sum, 0.0f, 1.0f);
}

}  // namespace shoal
