#include "engine/flip.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "io/result.h"

namespace shoal {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr float kColorExponent = 0.7f, kFeatureExponent = 0.5f;
constexpr float kColorKnee = 0.4f, kColorKneeValue = 0.95f;
constexpr double kFeatureWidthDegrees = 0.082;
constexpr std::array<float, 3> kWhite = {0.950428545f, 1.0f, 1.088900371f};  ///< XYZ of linear RGB (1, 1, 1)

using Triple = std::array<float, 3>;
using Kernel = std::vector<float>;  ///< odd length, centre in the middle
using Plane = std::vector<float>;

Triple xyz_of(const Triple& rgb) {
  return {10135552.0f / 24577794 * rgb[0] + 8788810.0f / 24577794 * rgb[1] + 4435075.0f / 24577794 * rgb[2],
          2613072.0f / 12288897 * rgb[0] + 8788810.0f / 12288897 * rgb[1] + 887015.0f / 12288897 * rgb[2],
          1425312.0f / 73733382 * rgb[0] + 8788810.0f / 73733382 * rgb[1] + 70074185.0f / 73733382 * rgb[2]};
}

Triple rgb_of(const Triple& xyz) {
  return {3.241003275f * xyz[0] - 1.537398934f * xyz[1] - 0.498615861f * xyz[2],
          -0.969224334f * xyz[0] + 1.875930071f * xyz[1] + 0.041554224f * xyz[2],
          0.055639423f * xyz[0] - 0.204011202f * xyz[1] + 1.057148933f * xyz[2]};
}

/// L*a*b* without its cube root: the space in which the eye's filters work.
Triple ycxcz_of(const Triple& rgb) {
  const Triple xyz = xyz_of(rgb);
  const float x = xyz[0] / kWhite[0], y = xyz[1] / kWhite[1], z = xyz[2] / kWhite[2];
  return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}

Triple rgb_of_ycxcz(const Triple& seen) {
  const float y = (seen[0] + 16) / 116;
  Triple rgb = rgb_of({(y + seen[1] / 500) * kWhite[0], y * kWhite[1], (y - seen[2] / 200) * kWhite[2]});
  for (float& c : rgb) c = std::clamp(c, 0.0f, 1.0f);
  return rgb;
}

Triple hunt_lab_of(const Triple& rgb) {
  constexpr float kDelta = 6.0f / 29;
  Triple root = xyz_of(rgb);
  for (size_t c = 0; c < 3; ++c) {
    const float v = root[c] / kWhite[c];
    root[c] = v > kDelta * kDelta * kDelta ? std::cbrt(v) : v / (3 * kDelta * kDelta) + 4.0f / 29;
  }
  const float lightness = 116 * root[1] - 16;
  return {lightness, 0.01f * lightness * 500 * (root[0] - root[1]), 0.01f * lightness * 200 * (root[1] - root[2])};
}

float color_distance(const float* a, const float* b) {
  const float da = a[1] - b[1], db = a[2] - b[2];
  return std::pow(std::abs(a[0] - b[0]) + std::sqrt(da * da + db * db), kColorExponent);
}

/// Distance of the two colours furthest apart, green and blue.
float largest_color_distance() {
  static const float largest = color_distance(hunt_lab_of({0, 1, 0}).data(), hunt_lab_of({0, 0, 1}).data());
  return largest;
}

float color_error(const float* a, const float* b) {
  const float largest = largest_color_distance(), knee = kColorKnee * largest;
  const float distance = color_distance(a, b);
  if (distance < knee) return distance * kColorKneeValue / knee;
  return kColorKneeValue + (distance - knee) / (largest - knee) * (1 - kColorKneeValue);
}

/// Samples of f at -radius .. radius.
template <class F>
Kernel sampled(int radius, F&& f) {
  Kernel kernel;
  for (int i = -radius; i <= radius; ++i) kernel.push_back(static_cast<float>(f(static_cast<double>(i))));
  return kernel;
}

double sum_of(const Kernel& kernel) {
  double sum = 0;
  for (const float w : kernel) sum += w;
  return sum;
}

/// Divides positive weights by their sum and negative ones by theirs, so that each side adds up to 1.
Kernel balanced(Kernel kernel) {
  double positive = 0, negative = 0;
  for (const float w : kernel) (w > 0 ? positive : negative) += std::abs(w);
  for (float& w : kernel) w = static_cast<float>(w / (w > 0 ? positive : negative > 0 ? negative : 1));
  return kernel;
}

/// Along rows (`step_x` 1) or columns; beyond the edges the picture goes on as it ends.
Plane filter(const Plane& in, int width, int height, const Kernel& kernel, bool along_rows) {
  const int radius = static_cast<int>(kernel.size() / 2), last = (along_rows ? width : height) - 1;
  const ptrdiff_t stride = along_rows ? 1 : width;
  Plane out(in.size());
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int at = along_rows ? x : y;
      const float* line = in.data() + (along_rows ? static_cast<ptrdiff_t>(y) * width : x);
      float sum = 0;
      for (int k = -radius; k <= radius; ++k) {
        sum += kernel[static_cast<size_t>(k + radius)] * line[std::clamp(at + k, 0, last) * stride];
      }
      out[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)] = sum;
    }
  }
  return out;
}

Plane filter_both(const Plane& in, int width, int height, const Kernel& rows, const Kernel& columns) {
  return filter(filter(in, width, height, rows, true), width, height, columns, false);
}

/// Table 1 of the paper: luminance, red-green, blue-yellow.
struct Sensitivity {
  double a[2], b[2];
};
constexpr Sensitivity kSensitivity[3] = {{{1, 0}, {0.0047, 1e-5}}, {{1, 0}, {0.0053, 1e-5}}, {{34.1, 13.5}, {0.04, 0.025}}};

/// A channel as the eye resolves it: the sum of two Gaussians, each separable, divided by the sum of all weights.
Plane blur(const Plane& in, int width, int height, const Sensitivity& eye, double pixels_per_degree) {
  constexpr double kWidestScale = 0.04;
  const int radius = static_cast<int>(std::ceil(3 * std::sqrt(kWidestScale / (2 * kPi * kPi)) * pixels_per_degree));
  Plane out(in.size(), 0.0f);
  double weights[2] = {0, 0};
  std::array<Kernel, 2> kernels;
  for (size_t g = 0; g < 2; ++g) {
    if (eye.a[g] == 0) continue;
    kernels[g] = sampled(radius, [&](double i) {
      const double x = i / pixels_per_degree;
      return std::exp(-kPi * kPi * x * x / eye.b[g]);
    });
    const double sum = sum_of(kernels[g]);
    weights[g] = eye.a[g] * std::sqrt(kPi / eye.b[g]) * sum * sum;
    for (float& w : kernels[g]) w = static_cast<float>(w / sum);
  }
  for (size_t g = 0; g < 2; ++g) {
    if (weights[g] == 0) continue;
    const Plane part = filter_both(in, width, height, kernels[g], kernels[g]);
    const float share = static_cast<float>(weights[g] / (weights[0] + weights[1]));
    for (size_t i = 0; i < out.size(); ++i) out[i] += share * part[i];
  }
  return out;
}

/// Length of the gradient that `derivative` and `smooth` take.
Plane gradient(const Plane& in, int width, int height, const Kernel& derivative, const Kernel& smooth) {
  Plane x = filter_both(in, width, height, derivative, smooth);
  const Plane y = filter_both(in, width, height, smooth, derivative);
  for (size_t i = 0; i < x.size(); ++i) x[i] = std::sqrt(x[i] * x[i] + y[i] * y[i]);
  return x;
}

/// ACES as the HDR paper fits it (its equation 3, after Narkowicz), per channel.
float aces(float x) {
  constexpr float kA = 0.6f * 0.6f * 2.51f, kB = 0.6f * 0.03f, kC = 0.6f * 0.6f * 2.43f, kD = 0.6f * 0.59f, kE = 0.14f;
  return std::clamp((kA * x * x + kB * x) / (kC * x * x + kD * x + kE), 0.0f, 1.0f);
}

/// Where the curve reaches 0.85: what the brightest and the median pixel are exposed to.
double aces_at_085() {
  constexpr double kT = 0.85;
  const double a = 0.36 * 2.51 - kT * 0.36 * 2.43, b = 0.6 * 0.03 - kT * 0.6 * 0.59, c = -kT * 0.14;
  return (-b + std::sqrt(b * b - 4 * a * c)) / (2 * a);
}

float usable(float v) { return v > 0 ? std::min(v, 1e30f) : 0.0f; }

std::vector<float> exposed(std::span<const float> radiance, float scale) {
  std::vector<float> out(radiance.size());
  for (size_t i = 0; i < out.size(); ++i) out[i] = aces(std::min(usable(radiance[i]) * scale, 1e9f));
  return out;
}

}  // namespace

FlipReference::FlipReference(uint32_t width, uint32_t height, std::span<const float> rgb, float pixels_per_degree)
    : width_(width), height_(height), pixels_per_degree_(pixels_per_degree), reference_(see(rgb)) {}

FlipReference::Seen FlipReference::see(std::span<const float> rgb) const {
  const size_t pixels = size_t{width_} * height_;
  SHOAL_CHECK(rgb.size() == pixels * 3);
  const int width = static_cast<int>(width_), height = static_cast<int>(height_);
  std::array<Plane, 3> planes;
  for (Plane& plane : planes) plane.resize(pixels);
  for (size_t i = 0; i < pixels; ++i) {
    Triple color;
    for (size_t c = 0; c < 3; ++c) color[c] = rgb[i * 3 + c] > 0 ? std::min(rgb[i * 3 + c], 1.0f) : 0.0f;
    const Triple seen = ycxcz_of(color);
    for (size_t c = 0; c < 3; ++c) planes[c][i] = seen[c];
  }
  Seen seen;
  Plane luminance = planes[0];
  for (float& y : luminance) y = (y + 16) / 116;
  const double deviation = 0.5 * kFeatureWidthDegrees * pixels_per_degree_;
  const int radius = static_cast<int>(std::ceil(3 * deviation));
  const auto gauss = [&](double i) { return std::exp(-i * i / (2 * deviation * deviation)); };
  Kernel smooth = sampled(radius, gauss);
  const double sum = sum_of(smooth);
  for (float& w : smooth) w = static_cast<float>(w / sum);
  const Kernel edge = balanced(sampled(radius, [&](double i) { return -i * gauss(i); }));
  const Kernel point = balanced(sampled(radius, [&](double i) { return (i * i / (deviation * deviation) - 1) * gauss(i); }));
  seen.edges = gradient(luminance, width, height, edge, smooth);
  seen.points = gradient(luminance, width, height, point, smooth);

  for (size_t c = 0; c < 3; ++c) planes[c] = blur(planes[c], width, height, kSensitivity[c], pixels_per_degree_);
  seen.lab.resize(pixels * 3);
  for (size_t i = 0; i < pixels; ++i) {
    const Triple lab = hunt_lab_of(rgb_of_ycxcz({planes[0][i], planes[1][i], planes[2][i]}));
    std::copy(lab.begin(), lab.end(), seen.lab.begin() + static_cast<ptrdiff_t>(i * 3));
  }
  return seen;
}

std::vector<float> FlipReference::compare(std::span<const float> rgb) const {
  const Seen test = see(rgb);
  std::vector<float> map(reference_.edges.size());
  for (size_t i = 0; i < map.size(); ++i) {
    const float color = color_error(&reference_.lab[i * 3], &test.lab[i * 3]);
    const float difference = std::max(std::abs(reference_.edges[i] - test.edges[i]),
                                      std::abs(reference_.points[i] - test.points[i]));
    const float feature = std::pow(std::min(difference / std::sqrt(2.0f), 1.0f), kFeatureExponent);
    map[i] = color > 0 ? std::pow(std::min(color, 1.0f), 1 - feature) : 0.0f;
  }
  return map;
}

std::vector<float> hdr_flip(uint32_t width, uint32_t height, std::span<const float> reference,
                            std::span<const float> test) {
  std::vector<float> luminance(size_t{width} * height);
  SHOAL_CHECK(reference.size() == luminance.size() * 3 && test.size() == reference.size());
  for (size_t i = 0; i < luminance.size(); ++i) {
    luminance[i] = 0.2126f * usable(reference[i * 3]) + 0.7152f * usable(reference[i * 3 + 1]) +
                   0.0722f * usable(reference[i * 3 + 2]);
  }
  std::sort(luminance.begin(), luminance.end());
  // Of an even number the mean of both in the middle, as in the authors' program; black pictures are looked at as
  // they are.
  const size_t n = luminance.size();
  const double middle = 0.5 * (static_cast<double>(luminance[(n - 1) / 2]) + luminance[n / 2]);
  const double brightest = luminance.back() > 0 ? luminance.back() : aces_at_085();
  const double median = middle > 0 ? middle : brightest;
  const double first = std::log2(aces_at_085() / brightest), last = std::log2(aces_at_085() / median);
  const int count = static_cast<int>(std::clamp(std::ceil(last - first), 2.0, 40.0));
  std::vector<float> map(n, 0.0f);
  for (int step = 0; step < count; ++step) {
    const float scale = static_cast<float>(std::exp2(first + (last - first) * step / (count - 1)));
    const std::vector<float> part = FlipReference(width, height, exposed(reference, scale)).compare(exposed(test, scale));
    for (size_t i = 0; i < n; ++i) map[i] = std::max(map[i], part[i]);
  }
  return map;
}

double mean_value(std::span<const float> map) {
  double sum = 0;
  for (const float v : map) sum += v;
  return map.empty() ? 0 : sum / static_cast<double>(map.size());
}

}  // namespace shoal
