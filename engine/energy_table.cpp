#include "engine/energy_table.h"

#include <algorithm>
#include <cmath>

#include "engine/fill_table.h"
#include "engine/math.h"
#include "engine/microfacet.h"

namespace shoal {
namespace {

// Axes: the fourth roots of mu and alpha, so that the change at mu ~ alpha is resolved down to kMinAlpha.
constexpr int kMuCount = 64, kAlphaCount = 48, kSteps = 36;
constexpr float kFirstRow = 0.177827941f;  // kMinAlpha^(1/4)

float alpha_at(int row) {
  const float y = kFirstRow + (1 - kFirstRow) * static_cast<float>(row) / (kAlphaCount - 1);
  return std::clamp((y * y) * (y * y), kMinAlpha, 1.0f);
}
float mu_at(int column) {
  const float x =
      (static_cast<float>(column) + 0.25f) / (kMuCount - 0.75f);  // mu = 0 itself has no limit to tabulate
  return (x * x) * (x * x);
}

struct AxisPoint {
  int cell;
  float fraction;
};
AxisPoint axis_point(float x, int count) {
  const float clamped = std::clamp(x, 0.0f, static_cast<float>(count - 1));
  const int cell = std::min(static_cast<int>(clamped), count - 2);
  return {cell, clamped - static_cast<float>(cell)};
}

}  // namespace

SpecularAlbedo integrate_specular_albedo(float mu, float alpha, int steps) {
  // With visible-normal sampling the estimator of the albedo is G2 / G1 = (1 + Lo) / (1 + Lo + Li) above the
  // horizon and 0 below (Heitz 2018 eq. 19). It is symmetric in phi: half the circle is enough.
  const Ggx ggx{alpha};
  const Vec3 wo(std::sqrt(std::max(0.0f, (1 - mu) * (1 + mu))), 0, mu);
  const float one_plus_lambda_o = 1 + ggx.lambda(wo);
  double a = 0, b = 0;
  for (int i = 0; i < steps; ++i) {
    for (int k = 0; k < steps; ++k) {
      const float u1 = 0.5f * (static_cast<float>(i) + 0.5f) / static_cast<float>(steps);
      const float s = (static_cast<float>(k) + 0.5f) / static_cast<float>(steps);
      const float u2 = 1 - s * s;  // denser in the tail of the lobe, where reflections go below the horizon
      const Vec3 h = ggx.sample_visible_normal(wo, u1, u2);
      const float cosine = glm::dot(wo, h);
      const Vec3 wi = 2 * cosine * h - wo;
      if (!(wi.z > 0)) continue;
      const double weight = 2 * s * one_plus_lambda_o / (one_plus_lambda_o + ggx.lambda(wi));
      const double schlick = power5(std::clamp(1 - cosine, 0.0f, 1.0f));
      a += weight * (1 - schlick), b += weight * schlick;
    }
  }
  const double count = static_cast<double>(steps) * steps;
  return {static_cast<float>(a / count), static_cast<float>(b / count)};
}

EnergyTable::EnergyTable(unsigned threads) : cells_(kAlphaCount * kMuCount) {
  fill_table(cells_, threads, [](size_t i) {
    const int row = static_cast<int>(i) / kMuCount, column = static_cast<int>(i) % kMuCount;
    return integrate_specular_albedo(mu_at(column), alpha_at(row), kSteps);
  });
}

SpecularAlbedo EnergyTable::albedo(float mu, float alpha) const {
  const float x = std::sqrt(std::sqrt(mu)) * (kMuCount - 0.75f) - 0.25f;
  const float y = (std::sqrt(std::sqrt(alpha)) - kFirstRow) / (1 - kFirstRow) * (kAlphaCount - 1);
  const AxisPoint column = axis_point(x, kMuCount), row = axis_point(y, kAlphaCount);
  const SpecularAlbedo* c = cells_.data() + row.cell * kMuCount + column.cell;
  const auto mix = [&](float c00, float c01, float c10, float c11) {
    const float low = c00 + column.fraction * (c01 - c00), high = c10 + column.fraction * (c11 - c10);
    return low + row.fraction * (high - low);
  };
  return {mix(c[0].a, c[1].a, c[kMuCount].a, c[kMuCount + 1].a),
          mix(c[0].b, c[1].b, c[kMuCount].b, c[kMuCount + 1].b)};
}

}  // namespace shoal
