#include "engine/lobe_tables.h"

#include <algorithm>
#include <cmath>

#include "engine/math.h"
#include "engine/microfacet.h"
#include "engine/sheen.h"

namespace shoal {
namespace {

constexpr float kFirstRow = 0.177827941f;  // kMinAlpha^(1/4)

/// A place on an axis of `count` nodes at 0, 1, ..: the cell below and how far into it.
struct AxisPoint {
  int cell;
  float fraction;
};
AxisPoint axis_point(float x, int count) {
  const float clamped = std::clamp(x, 0.0f, static_cast<float>(count - 1));
  const int cell = std::min(static_cast<int>(clamped), count - 2);
  return {cell, clamped - static_cast<float>(cell)};
}

/// Fourth roots, as in engine/energy_table.cpp. mu = 0 itself has no limit to tabulate.
float mu_at(int i, int count) {
  const float x = (static_cast<float>(i) + 0.25f) / (static_cast<float>(count) - 0.75f);
  return (x * x) * (x * x);
}
float mu_place(float mu, int count) {
  return std::sqrt(std::sqrt(mu)) * (static_cast<float>(count) - 0.75f) - 0.25f;
}
float alpha_at(int i, int count) {
  const float y = kFirstRow + (1 - kFirstRow) * static_cast<float>(i) / static_cast<float>(count - 1);
  return std::clamp((y * y) * (y * y), kMinAlpha, 1.0f);
}
float alpha_place(float alpha, int count) {
  return (std::sqrt(std::sqrt(alpha)) - kFirstRow) / (1 - kFirstRow) * static_cast<float>(count - 1);
}
float even_at(int i, int count) { return static_cast<float>(i) / static_cast<float>(count - 1); }

// Glass: the axis of eta is the reflectance amplitude r = (eta - 1) / (eta + 1), a half for each side, with nodes that
// crowd at eta = 1, where what is lost changes fastest; at 1 itself nothing is above or below.
constexpr int kGlassMu = 40, kGlassAlpha = 24, kGlassEta = 15;
/// The rougher, the more of the integrand is cut off by total reflection and the horizon.
int glass_steps(int row) { return 12 + 16 * row / (kGlassAlpha - 1); }
constexpr float kGlassReach = 0.6f;  // an index of 4; diamond is at 0.41
constexpr float kLeastAmplitude = 5e-4f;

float eta_at(int i, bool denser) {
  const float x = even_at(i, kGlassEta), r = std::max(kGlassReach * x * x, kLeastAmplitude);
  return denser ? (1 + r) / (1 - r) : (1 - r) / (1 + r);
}

constexpr int kSheenMu = 48, kSheenAlpha = 28, kSheenSteps = 48;
constexpr float kFirstSheenRow = 0.141421356f;  // kMinSheenAlpha^(1/2)
constexpr int kTurnedMu = 20, kTurnedPhi = 11, kTurnedAlpha = 14, kTurnedStrength = 10;
int turned_steps(int row) { return 8 + 14 * row / (kTurnedAlpha - 1); }
/// Azimuths from x to y, crowded at y: there the smooth direction begins to count, within alpha_y / alpha_x.
float phi_at(int i) {
  const float x = 1 - even_at(i, kTurnedPhi);
  return 0.5f * kPi * (1 - x * x);
}

SpecularAlbedo mix(const SpecularAlbedo& p, const SpecularAlbedo& q, float t) {
  return {p.a + t * (q.a - p.a), p.b + t * (q.b - p.b)};
}
GlassAlbedo mix(const GlassAlbedo& p, const GlassAlbedo& q, float t) {
  return {p.a + t * (q.a - p.a), p.b + t * (q.b - p.b), p.total + t * (q.total - p.total), p.c + t * (q.c - p.c),
          p.d + t * (q.d - p.d)};
}
float mix(float p, float q, float t) { return p + t * (q - p); }

/// Multilinear in the axes, the innermost first; `strides` in cells.
template <class Cell>
Cell interpolate(const Cell* at, const AxisPoint* axes, const int* strides, int count) {
  if (count == 0) return *at;
  const Cell* low = at + static_cast<ptrdiff_t>(axes[count - 1].cell) * strides[count - 1];
  const Cell p = interpolate(low, axes, strides, count - 1);
  const Cell q = interpolate(low + strides[count - 1], axes, strides, count - 1);
  return mix(p, q, axes[count - 1].fraction);
}

}  // namespace

bool refract(const Vec3& wo, const Vec3& h, float eta, float& cos_t, Vec3& wi) {
  const float cosine = glm::dot(wo, h), inverse = 1 / eta;
  const float sine2 = std::max(0.0f, 1 - cosine * cosine) * inverse * inverse;  // Snell's law
  if (!(sine2 < 1)) return false;
  cos_t = std::sqrt(1 - sine2);
  wi = (cosine * inverse - cos_t) * h - inverse * wo;
  return true;
}

GlassAlbedo integrate_glass_albedo(float mu, float alpha, float eta, int steps) {
  const Ggx ggx{alpha};
  const Vec3 wo(std::sqrt(std::max(0.0f, (1 - mu) * (1 + mu))), 0, mu);
  const float one_plus_lambda_o = 1 + ggx.lambda(wo);
  double sum[5] = {};
  for (int i = 0; i < steps; ++i) {
    for (int k = 0; k < steps; ++k) {
      const float u1 = 0.5f * (static_cast<float>(i) + 0.5f) / static_cast<float>(steps);
      const float s = (static_cast<float>(k) + 0.5f) / static_cast<float>(steps);
      const Vec3 h = ggx.sample_visible_normal(wo, u1, 1 - s * s);  // denser in the tail, as in the energy table
      const float cosine = std::clamp(glm::dot(wo, h), 0.0f, 1.0f);
      const Vec3 reflected = 2 * cosine * h - wo;
      const double up = reflected.z > 0 ? 2 * s * one_plus_lambda_o / (one_plus_lambda_o + ggx.lambda(reflected)) : 0;
      float cos_t = 0;
      Vec3 wi;
      if (!refract(wo, h, eta, cos_t, wi)) {
        sum[2] += up;
        continue;
      }
      const double down = wi.z < 0 ? 2 * s / (1 + ggx.lambda(wi)) : 0.0f;
      const double schlick = power5(std::clamp(1 - (eta < 1 ? cos_t : cosine), 0.0f, 1.0f));
      sum[0] += up * (1 - schlick), sum[1] += up * schlick;
      sum[3] += down * (1 - schlick), sum[4] += down * schlick;
    }
  }
  const double count = static_cast<double>(steps) * steps;
  GlassAlbedo albedo;
  albedo.a = static_cast<float>(sum[0] / count), albedo.b = static_cast<float>(sum[1] / count);
  albedo.total = static_cast<float>(sum[2] / count);
  albedo.c = static_cast<float>(sum[3] / count), albedo.d = static_cast<float>(sum[4] / count);
  return albedo;
}

GlassTable::GlassTable() {
  for (int e = 0; e < 2 * kGlassEta; ++e) {
    const float eta = eta_at(e % kGlassEta, e >= kGlassEta);
    for (int row = 0; row < kGlassAlpha; ++row) {
      for (int column = 0; column < kGlassMu; ++column) {
        cells_.push_back(integrate_glass_albedo(mu_at(column, kGlassMu), alpha_at(row, kGlassAlpha), eta,
                                                glass_steps(row)));
      }
    }
  }
}

GlassAlbedo GlassTable::albedo(float mu, float alpha, float eta) const {
  const float r = std::abs(eta - 1) / (eta + 1);
  const AxisPoint axes[] = {axis_point(mu_place(mu, kGlassMu), kGlassMu),
                            axis_point(alpha_place(alpha, kGlassAlpha), kGlassAlpha),
                            axis_point(std::sqrt(r / kGlassReach) * (kGlassEta - 1), kGlassEta)};
  const int strides[] = {1, kGlassMu, kGlassMu * kGlassAlpha};
  const GlassAlbedo* side = cells_.data() + (eta >= 1 ? kGlassMu * kGlassAlpha * kGlassEta : 0);
  return interpolate(side, axes, strides, 3);
}

float integrate_sheen_albedo(float mu, float alpha, int steps) {
  const Sheen sheen{alpha};
  const Vec3 wo(std::sqrt(std::max(0.0f, (1 - mu) * (1 + mu))), 0, mu);
  double sum = 0;
  for (int i = 0; i < steps; ++i) {
    // cos = t^2: denser where fibres reflect, near the horizon.
    const float t = (static_cast<float>(i) + 0.5f) / static_cast<float>(steps), z = t * t;
    const float sine = std::sqrt((1 - z) * (1 + z));
    for (int k = 0; k < steps; ++k) {
      const SinCos phi = sin_cos(kPi * (static_cast<float>(k) + 0.5f) / static_cast<float>(steps));
      sum += 2.0 * t * sheen.value(wo, {sine * phi.cos, sine * phi.sin, z});
    }
  }
  return static_cast<float>(sum * (2.0 * kPi) / (static_cast<double>(steps) * steps));
}

SheenTable::SheenTable() {
  for (int row = 0; row < kSheenAlpha; ++row) {
    const float y = kFirstSheenRow + (1 - kFirstSheenRow) * even_at(row, kSheenAlpha);
    const float alpha = std::clamp(y * y, kMinSheenAlpha, 1.0f);
    for (int column = 0; column < kSheenMu; ++column) {
      cells_.push_back(integrate_sheen_albedo(mu_at(column, kSheenMu), alpha, kSheenSteps));
    }
  }
}

float SheenTable::albedo(float mu, float alpha) const {
  const AxisPoint axes[] = {axis_point(mu_place(mu, kSheenMu), kSheenMu),
                            axis_point((std::sqrt(alpha) - kFirstSheenRow) / (1 - kFirstSheenRow) * (kSheenAlpha - 1),
                                       kSheenAlpha)};
  const int strides[] = {1, kSheenMu};
  return interpolate(cells_.data(), axes, strides, 2);
}

SpecularAlbedo integrate_anisotropic_albedo(const Vec3& wo, float alpha, float strength, int steps) {
  const GgxAnisotropic ggx = anisotropic_ggx(alpha, strength);
  const float one_plus_lambda_o = 1 + ggx.lambda(wo);
  double a = 0, b = 0;
  for (int i = 0; i < 2 * steps; ++i) {
    for (int k = 0; k < steps; ++k) {
      const float u1 = 0.5f * (static_cast<float>(i) + 0.5f) / static_cast<float>(steps);
      const float s = (static_cast<float>(k) + 0.5f) / static_cast<float>(steps);
      const Vec3 h = ggx.sample_visible_normal(wo, u1, 1 - s * s);
      const float cosine = glm::dot(wo, h);
      const Vec3 wi = 2 * cosine * h - wo;
      if (!(wi.z > 0)) continue;
      const double weight = 2 * s * one_plus_lambda_o / (one_plus_lambda_o + ggx.lambda(wi));
      const double schlick = power5(std::clamp(1 - cosine, 0.0f, 1.0f));
      a += weight * (1 - schlick), b += weight * schlick;
    }
  }
  const double count = 2.0 * steps * steps;
  return {static_cast<float>(a / count), static_cast<float>(b / count)};
}

AnisotropyTable::AnisotropyTable() {
  for (int t = 0; t < kTurnedStrength; ++t) {
    for (int row = 0; row < kTurnedAlpha; ++row) {
      for (int p = 0; p < kTurnedPhi; ++p) {
        const SinCos phi = sin_cos(phi_at(p));
        for (int column = 0; column < kTurnedMu; ++column) {
          const float mu = mu_at(column, kTurnedMu), sine = std::sqrt(std::max(0.0f, (1 - mu) * (1 + mu)));
          cells_.push_back(integrate_anisotropic_albedo({sine * phi.cos, sine * phi.sin, mu},
                                                        alpha_at(row, kTurnedAlpha), even_at(t, kTurnedStrength),
                                                        turned_steps(row)));
        }
      }
    }
  }
}

SpecularAlbedo AnisotropyTable::albedo(const Vec3& wo, float alpha, float strength) const {
  const float turn = arc_tangent(std::abs(wo.y), std::abs(wo.x)) / (0.5f * kPi);
  const AxisPoint axes[] = {axis_point(mu_place(std::min(wo.z, 1.0f), kTurnedMu), kTurnedMu),
                            axis_point((1 - std::sqrt(std::max(0.0f, 1 - turn))) * (kTurnedPhi - 1), kTurnedPhi),
                            axis_point(alpha_place(alpha, kTurnedAlpha), kTurnedAlpha),
                            axis_point(strength * (kTurnedStrength - 1), kTurnedStrength)};
  const int strides[] = {1, kTurnedMu, kTurnedMu * kTurnedPhi, kTurnedMu * kTurnedPhi * kTurnedAlpha};
  return interpolate(cells_.data(), axes, strides, 4);
}

}  // namespace shoal
