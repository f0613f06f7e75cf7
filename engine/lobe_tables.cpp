#include "engine/lobe_tables.h"

#include <algorithm>
#include <cmath>

#include "engine/fill_table.h"
#include "engine/math.h"
#include "engine/microfacet.h"
#include "engine/sheen.h"

namespace shoal {
namespace {

constexpr float kFirstRow = 0.177827941f;  // kMinAlpha^(1/4)

/// A place on an axis of `count` nodes at 0, 1, ..: the four nodes around it and their weights (Catmull & Rom 1974).
/// Beyond the ends the first and last parabolas go on: a mirrored node would bend the curve there.
struct AxisPoint {
  int node[4];
  float weight[4];
};
AxisPoint axis_point(float x, int count) {
  const float clamped = std::clamp(x, 0.0f, static_cast<float>(count - 1));
  const int cell = std::min(static_cast<int>(clamped), count - 2);
  const float t = clamped - static_cast<float>(cell), t2 = t * t, t3 = t2 * t;
  AxisPoint p{{cell - 1, cell, cell + 1, cell + 2},
              {0.5f * (2 * t2 - t3 - t), 0.5f * (3 * t3 - 5 * t2) + 1, 0.5f * (4 * t2 - 3 * t3 + t), 0.5f * (t3 - t2)}};
  if (cell == 0) {  // the node before is 3 v[0] - 3 v[1] + v[2]
    const float w = p.weight[0];
    p.node[0] = 0, p.weight[0] = 0;
    p.weight[1] += 3 * w, p.weight[2] -= 3 * w, p.weight[3] += w;
  }
  if (cell == count - 2) {
    const float w = p.weight[3];
    p.node[3] = cell, p.weight[3] = 0;
    p.weight[2] += 3 * w, p.weight[1] -= 3 * w, p.weight[0] += w;
  }
  return p;
}

/// Points that fill the unit square evenly without rows, which an edge of the integrand could run along.
struct LatticePoint {
  float u, v;
  /// Denser in the tail of a lobe, where directions leave by the wrong side; below 1. The weight is 2 u.
  float tail() const { return std::min(1 - u * u, 0x1.fffffep-1f); }
};
LatticePoint lattice_point(int i, int count) {
  const double turn = i * 0.6180339887498949;  // the golden section
  return {(static_cast<float>(i) + 0.5f) / static_cast<float>(count),
          std::min(static_cast<float>(turn - std::floor(turn)), 0x1.fffffep-1f)};
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

constexpr int kGlassMu = 32, kGlassAlpha = 20;
/// The rougher, the more of the integrand is cut off by total reflection and the horizon.
int glass_points(int row) { return 300 + 3000 * row / (kGlassAlpha - 1); }
/// More indices of refraction than these are read between so many. A slice takes about 0.1 s.
constexpr size_t kMostIndices = 8;
/// Where a slice stands between others: what is lost changes fastest near an index of 1.
float index_place(float ior) { return std::sqrt((ior - 1) / (ior + 1)); }

constexpr int kSheenMu = 36, kSheenAlpha = 22, kSheenSteps = 48;
constexpr float kFirstSheenRow = 0.141421356f;  // kMinSheenAlpha^(1/2)
constexpr int kTurnedMu = 24, kTurnedPhi = 13, kTurnedAlpha = 16, kTurnedStretch = 9;
/// By the rougher direction.
int turned_points(float alpha_x) { return 120 + static_cast<int>(300 * std::sqrt(std::sqrt(alpha_x))); }
/// How far alpha_x is from alpha_y to 1, in fourth roots: even steps change the lobe evenly.
float stretch_at(int i, float alpha) {
  const float root = std::sqrt(std::sqrt(alpha)), x = root + (1 - root) * even_at(i, kTurnedStretch);
  return (x * x) * (x * x);
}
float stretch_place(const GgxAnisotropic& ggx) {
  const float root = std::sqrt(std::sqrt(ggx.alpha_y)), range = 1 - root;
  return range > 0 ? (std::sqrt(std::sqrt(ggx.alpha_x)) - root) / range * (kTurnedStretch - 1) : 0.0f;
}
/// Azimuths from x to y, crowded at y: there the smooth direction begins to count, within alpha_y / alpha_x.
float phi_at(int i) {
  const float x = 1 - even_at(i, kTurnedPhi);
  return 0.5f * kPi * (1 - x * x);
}

void add(SpecularAlbedo& sum, const SpecularAlbedo& v, float weight) { sum.a += weight * v.a, sum.b += weight * v.b; }
void add(GlassAlbedo& sum, const GlassAlbedo& v, float weight) {
  sum.a += weight * v.a, sum.b += weight * v.b, sum.total += weight * v.total;
  sum.c += weight * v.c, sum.d += weight * v.d;
}
void add(float& sum, float v, float weight) { sum += weight * v; }

/// Cubic along each axis, the innermost first; `strides` in cells.
template <class Cell>
Cell interpolate(const Cell* at, const AxisPoint* axes, const int* strides, int count) {
  if (count == 0) return *at;
  const AxisPoint& axis = axes[count - 1];
  Cell sum{};
  for (int k = 0; k < 4; ++k) {
    if (axis.weight[k] == 0) continue;
    const Cell* line = at + static_cast<ptrdiff_t>(axis.node[k]) * strides[count - 1];
    add(sum, interpolate(line, axes, strides, count - 1), axis.weight[k]);
  }
  return sum;
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

GlassAlbedo integrate_glass_albedo(float mu, float alpha, float eta, int count) {
  const Ggx ggx{alpha};
  const Vec3 wo(std::sqrt(std::max(0.0f, (1 - mu) * (1 + mu))), 0, mu);
  const float one_plus_lambda_o = 1 + ggx.lambda(wo);
  double sum[5] = {};
  for (int i = 0; i < count; ++i) {
    const LatticePoint at = lattice_point(i, count);
    const float s = at.u;
    const Vec3 h = ggx.sample_visible_normal(wo, 0.5f * at.v, at.tail());
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
  GlassAlbedo albedo;
  albedo.a = static_cast<float>(sum[0] / count), albedo.b = static_cast<float>(sum[1] / count);
  albedo.total = static_cast<float>(sum[2] / count);
  albedo.c = static_cast<float>(sum[3] / count), albedo.d = static_cast<float>(sum[4] / count);
  return albedo;
}

GlassTable::GlassTable(std::vector<float> indices, unsigned threads) {
  if (indices.empty()) indices = {1.5f};
  for (float& ior : indices) ior = std::max(ior, 1 + kLeastBending);
  std::sort(indices.begin(), indices.end());
  indices.erase(std::unique(indices.begin(), indices.end()), indices.end());
  for (const float ior : indices) places_.push_back(index_place(ior));
  if (indices.size() > kMostIndices) {
    const float first = places_.front(), last = places_.back();
    indices.resize(kMostIndices), places_.resize(kMostIndices);
    for (size_t i = 0; i < kMostIndices; ++i) {
      places_[i] = first + (last - first) * even_at(static_cast<int>(i), kMostIndices);
      const float r = places_[i] * places_[i];
      indices[i] = (1 + r) / (1 - r);
    }
  }
  constexpr size_t kSlice = size_t{kGlassAlpha} * kGlassMu;
  cells_.resize(2 * indices.size() * kSlice);
  fill_table(cells_, threads, [&](size_t i) {
    const size_t slice = i / kSlice;
    const float ior = indices[slice / 2], eta = slice % 2 == 0 ? ior : 1 / ior;
    const int row = static_cast<int>(i % kSlice) / kGlassMu, column = static_cast<int>(i % kGlassMu);
    return integrate_glass_albedo(mu_at(column, kGlassMu), alpha_at(row, kGlassAlpha), eta, glass_points(row));
  });
}

GlassAlbedo GlassTable::albedo(float mu, float alpha, float eta) const {
  const AxisPoint axes[] = {axis_point(mu_place(mu, kGlassMu), kGlassMu),
                            axis_point(alpha_place(alpha, kGlassAlpha), kGlassAlpha)};
  const int strides[] = {1, kGlassMu};
  const float place = index_place(eta >= 1 ? eta : 1 / eta);
  const auto slice = [&](size_t i) {
    const size_t at = 2 * i + (eta >= 1 ? 0 : 1);
    return interpolate(cells_.data() + at * kGlassMu * kGlassAlpha, axes, strides, 2);
  };
  // The nearest below, and how far to the next; 1 / (1 / ior) may be an ulp off.
  const size_t above = static_cast<size_t>(std::upper_bound(places_.begin(), places_.end(), place) - places_.begin());
  if (above == 0) return slice(0);
  if (above == places_.size()) return slice(above - 1);
  const float t = (place - places_[above - 1]) / (places_[above] - places_[above - 1]);
  GlassAlbedo sum;
  add(sum, slice(above - 1), 1 - t);
  add(sum, slice(above), t);
  return sum;
}

float integrate_sheen_albedo(float mu, float alpha, int steps) {
  const Sheen sheen{alpha};
  const Vec3 wo(std::sqrt(std::max(0.0f, (1 - mu) * (1 + mu))), 0, mu);
  const float one_plus_lambda_o = 1 + sheen.lambda(std::min(mu, 1.0f));
  double sum = 0;
  for (int i = 0; i < steps; ++i) {
    // cos = t^2: denser where fibres reflect, near the horizon.
    const float t = (static_cast<float>(i) + 0.5f) / static_cast<float>(steps), z = t * t;
    const float sine = std::sqrt((1 - z) * (1 + z));
    double ring = 0;  // of the distribution; the rest of Sheen::value() is the same for all azimuths
    for (int k = 0; k < steps; ++k) {
      const SinCos phi = sin_cos(kPi * (static_cast<float>(k) + 0.5f) / static_cast<float>(steps));
      ring += sheen.d(glm::normalize(wo + Vec3(sine * phi.cos, sine * phi.sin, z)));
    }
    sum += 2.0 * t * ring / (4.0 * mu * (one_plus_lambda_o + sheen.lambda(z)));
  }
  return static_cast<float>(sum * (2.0 * kPi) / (static_cast<double>(steps) * steps));
}

SheenTable::SheenTable(unsigned threads) : cells_(size_t{kSheenAlpha} * kSheenMu) {
  fill_table(cells_, threads, [](size_t i) {
    const int row = static_cast<int>(i) / kSheenMu, column = static_cast<int>(i) % kSheenMu;
    const float y = kFirstSheenRow + (1 - kFirstSheenRow) * even_at(row, kSheenAlpha);
    return integrate_sheen_albedo(mu_at(column, kSheenMu), std::clamp(y * y, kMinSheenAlpha, 1.0f), kSheenSteps);
  });
}

float SheenTable::albedo(float mu, float alpha) const {
  const AxisPoint axes[] = {axis_point(mu_place(mu, kSheenMu), kSheenMu),
                            axis_point((std::sqrt(alpha) - kFirstSheenRow) / (1 - kFirstSheenRow) * (kSheenAlpha - 1),
                                       kSheenAlpha)};
  const int strides[] = {1, kSheenMu};
  return interpolate(cells_.data(), axes, strides, 2);
}

SpecularAlbedo integrate_anisotropic_albedo(const Vec3& wo, const GgxAnisotropic& ggx, int count) {
  const float one_plus_lambda_o = 1 + ggx.lambda(wo);
  double a = 0, b = 0;
  for (int i = 0; i < count; ++i) {
    const LatticePoint at = lattice_point(i, count);
    const Vec3 h = ggx.sample_visible_normal(wo, at.v, at.tail());
    const float cosine = glm::dot(wo, h);
    const Vec3 wi = 2 * cosine * h - wo;
    if (!(wi.z > 0)) continue;
    const double weight = 2 * at.u * one_plus_lambda_o / (one_plus_lambda_o + ggx.lambda(wi));
    const double schlick = power5(std::clamp(1 - cosine, 0.0f, 1.0f));
    a += weight * (1 - schlick), b += weight * schlick;
  }
  return {static_cast<float>(a / count), static_cast<float>(b / count)};
}

AnisotropyTable::AnisotropyTable(unsigned threads)
    : cells_(size_t{kTurnedStretch} * kTurnedAlpha * kTurnedPhi * kTurnedMu) {
  fill_table(cells_, threads, [](size_t i) {
    const int cell = static_cast<int>(i), column = cell % kTurnedMu, p = cell / kTurnedMu % kTurnedPhi;
    const int row = cell / (kTurnedMu * kTurnedPhi) % kTurnedAlpha, t = cell / (kTurnedMu * kTurnedPhi * kTurnedAlpha);
    const float alpha = alpha_at(row, kTurnedAlpha), mu = mu_at(column, kTurnedMu);
    const GgxAnisotropic ggx{stretch_at(t, alpha), alpha};
    const SinCos phi = sin_cos(phi_at(p));
    const float sine = std::sqrt(std::max(0.0f, (1 - mu) * (1 + mu)));
    return integrate_anisotropic_albedo({sine * phi.cos, sine * phi.sin, mu}, ggx, turned_points(ggx.alpha_x));
  });
}

SpecularAlbedo AnisotropyTable::albedo(const Vec3& wo, const GgxAnisotropic& ggx) const {
  const float turn = arc_tangent(std::abs(wo.y), std::abs(wo.x)) / (0.5f * kPi);
  const AxisPoint axes[] = {axis_point(mu_place(std::min(wo.z, 1.0f), kTurnedMu), kTurnedMu),
                            axis_point((1 - std::sqrt(std::max(0.0f, 1 - turn))) * (kTurnedPhi - 1), kTurnedPhi),
                            axis_point(alpha_place(ggx.alpha_y, kTurnedAlpha), kTurnedAlpha),
                            axis_point(stretch_place(ggx), kTurnedStretch)};
  const int strides[] = {1, kTurnedMu, kTurnedMu * kTurnedPhi, kTurnedMu * kTurnedPhi * kTurnedAlpha};
  return interpolate(cells_.data(), axes, strides, 4);
}

}  // namespace shoal
