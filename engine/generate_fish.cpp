#include "engine/generate_fish.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/generate_textures.h"
#include "engine/math.h"
#include "engine/noise.h"

namespace shoal {
namespace {

struct Section {
  float s, half_height, half_width, rise;  // s from nose to tail; rise of the centre line
};
constexpr std::array<Section, 10> kSections = {{{0.0f, 0.0f, 0.0f, -0.012f},
                                                {0.02f, 0.026f, 0.016f, -0.010f},
                                                {0.07f, 0.058f, 0.034f, -0.005f},
                                                {0.16f, 0.098f, 0.052f, 0.0f},
                                                {0.30f, 0.130f, 0.063f, 0.002f},
                                                {0.46f, 0.130f, 0.060f, 0.002f},
                                                {0.64f, 0.094f, 0.043f, 0.0f},
                                                {0.80f, 0.050f, 0.022f, 0.0f},
                                                {0.90f, 0.030f, 0.012f, 0.0f},
                                                {1.0f, 0.026f, 0.004f, 0.0f}}};
constexpr float kBodyLength = 0.82f;  // nose to the root of the tail, of a length of 1

float hermite(float a, float slope_a, float b, float slope_b, float width, float t) {
  const float t2 = t * t, t3 = t2 * t;
  return a * (2 * t3 - 3 * t2 + 1) + b * (3 * t2 - 2 * t3) +
         width * (slope_a * (t3 - 2 * t2 + t) + slope_b * (t3 - t2));
}

/// A smooth curve through the sections (cubic Hermite, central slopes).
float profile(float s, float Section::*member) {
  size_t k = 0;
  while (k + 2 < kSections.size() && s > kSections[k + 1].s) ++k;
  const auto slope = [&](size_t i) {
    const Section& lower = kSections[i == 0 ? 0 : i - 1];
    const Section& upper = kSections[std::min(i + 1, kSections.size() - 1)];
    return (upper.*member - lower.*member) / (upper.s - lower.s);
  };
  const float width = kSections[k + 1].s - kSections[k].s;
  return hermite(kSections[k].*member, slope(k), kSections[k + 1].*member, slope(k + 1), width,
                 (s - kSections[k].s) / width);
}

/// The stroke: sideways shift at s, growing towards the tail.
float sway(float s, float bend) { return 0.085f * s * s * sin_cos(2 * kPi * (bend + 0.75f * s)).sin; }

Vec3 bent(float s, float y, float x, float bend) { return Vec3(x + sway(s, bend), y, 0.5f - s * kBodyLength); }

/// A fin between two edges given as functions of t in [0, 1], a strip of quads.
template <class Lower, class Upper>
void add_fin(MeshData& mesh, uint32_t steps, float bend, Lower lower, Upper upper) {
  constexpr uint32_t kAcross = 6;
  const auto base = static_cast<uint32_t>(mesh.positions.size());
  for (uint32_t i = 0; i <= steps; ++i) {
    const float t = static_cast<float>(i) / static_cast<float>(steps);
    const Vec2 a = lower(t), b = upper(t);  // (s, y)
    for (uint32_t j = 0; j <= kAcross; ++j) {
      const float f = static_cast<float>(j) / kAcross;
      const Vec2 p = a + (b - a) * f;
      mesh.positions.push_back(bent(p.x, p.y, 0, bend));
      mesh.uvs.push_back({f, t});
    }
  }
  for (uint32_t i = 0; i < steps; ++i) {
    for (uint32_t j = 0; j < kAcross; ++j) {
      const uint32_t a = base + i * (kAcross + 1) + j, c = a + kAcross + 1;
      mesh.add_triangle(a, a + 1, c + 1);
      mesh.add_triangle(a, c + 1, c);
    }
  }
}

float mix(float a, float b, float t) { return a + (b - a) * t; }

}  // namespace

MeshData fish_body(uint32_t rings, uint32_t sides, float bend) {
  MeshData mesh;
  for (uint32_t i = 0; i <= rings; ++i) {
    const float even = static_cast<float>(i) / static_cast<float>(rings);
    const float s = even * (0.35f + 0.65f * even);  // finer at the head
    const float height = profile(s, &Section::half_height), width = profile(s, &Section::half_width);
    const float rise = profile(s, &Section::rise);
    for (uint32_t j = 0; j <= sides; ++j) {
      const float around = static_cast<float>(j) / static_cast<float>(sides);
      const SinCos turn = j == sides ? SinCos{0, 1} : sin_cos(2 * kPi * around);
      mesh.positions.push_back(bent(s, rise + height * turn.cos, width * turn.sin, bend));
      mesh.uvs.push_back({s, around < 0.5f ? 2 * around : 2 - 2 * around});
    }
  }
  for (uint32_t i = 0; i < rings; ++i) {
    for (uint32_t j = 0; j < sides; ++j) {
      const uint32_t a = i * (sides + 1) + j, c = a + sides + 1;
      if (i > 0) mesh.add_triangle(a, a + 1, c + 1);
      mesh.add_triangle(a, c + 1, c);
    }
  }
  compute_normals(mesh);
  return mesh;
}

MeshData fish_fins(float bend) {
  MeshData mesh;
  for (const float side : {1.0f, -1.0f}) {  // the forked tail's two lobes
    add_fin(
        mesh, 8, bend, [&](float t) { return Vec2(0.985f + 0.12f * t, side * 0.02f * (1 - t)); },
        [&](float t) { return Vec2(0.985f + 0.25f * t - 0.05f * t * t, side * mix(0.024f, 0.175f, t)); });
  }
  const auto height = [](float s) { return profile(s, &Section::half_height); };
  add_fin(
      mesh, 10, bend,  // back
      [&](float t) {
        const float s = mix(0.30f, 0.62f, t);
        return Vec2(s, height(s) - 0.012f);
      },
      [&](float t) {
        const float s = mix(0.30f, 0.62f, t);
        return Vec2(s + 0.07f, height(s) + 0.085f * (1 - t) * std::min(1.0f, 4 * t) + 0.008f);
      });
  add_fin(
      mesh, 8, bend,  // belly
      [&](float t) {
        const float s = mix(0.58f, 0.78f, t);
        return Vec2(s, 0.012f - height(s));
      },
      [&](float t) {
        const float s = mix(0.58f, 0.78f, t);
        return Vec2(s + 0.05f, -height(s) - 0.06f * (1 - t) * std::min(1.0f, 4 * t) - 0.006f);
      });
  add_fin(
      mesh, 6, bend,  // under the breast
      [&](float t) {
        const float s = mix(0.34f, 0.42f, t);
        return Vec2(s, 0.01f - height(s));
      },
      [&](float t) {
        const float s = mix(0.34f, 0.42f, t);
        return Vec2(s + 0.09f, -height(s) - 0.05f * (1 - t));
      });
  mesh.normals.assign(mesh.positions.size(), Vec3(1, 0, 0));
  return mesh;
}

Vec4 paint_fish(float u, float v) {
  const double side = smooth_step(0.26, 0.40, v + 0.03 * gradient_noise(u * 14, v * 4, 0, 3));
  const double belly = smooth_step(0.62, 0.85, v);
  Vec3 color = glm::mix(Vec3(0.16f, 0.33f, 0.44f), Vec3(0.80f, 0.87f, 0.90f), static_cast<float>(side));
  color = glm::mix(color, Vec3(0.96f, 0.97f, 0.95f), static_cast<float>(belly));
  const double stripe = (1 - smooth_step(0.015, 0.04, std::abs(v - 0.40))) * smooth_step(0.2, 0.3, u);
  color = glm::mix(color, Vec3(0.95f, 0.80f, 0.42f), 0.8f * static_cast<float>(stripe));
  const double gill = 1 - smooth_step(0.004, 0.012, std::abs(u - 0.225 - 0.12 * (v - 0.5) * (0.5 - v)));
  if (v > 0.2f && v < 0.85f) color *= 1 - 0.45f * static_cast<float>(gill);
  // The eye: texels are about 3.2 times as long as they are high on the head.
  const double du = (u - 0.105) * 3.0, dv = (v - 0.40) * 1.0;
  const double eye = std::sqrt(du * du + dv * dv);
  if (eye < 0.105) color = Vec3(0.92f, 0.84f, 0.55f);
  if (eye < 0.066) color = Vec3(0.02f);
  return Vec4(color, 1);
}

Vec4 paint_fish_normal(float u, float v) {
  const float rows = 22, columns = 46;
  const float row = std::floor(v * rows);
  const float shifted = u * columns + (static_cast<int>(row) % 2 == 0 ? 0.0f : 0.5f);
  const float x = shifted - std::floor(shifted) - 0.5f, y = v * rows - row - 0.5f;
  const float strength = 0.55f * static_cast<float>(smooth_step(0.2, 0.3, u) * (1 - smooth_step(0.9, 1, u)));
  return normal_texel(strength * (x + 0.3f), strength * y);
}

Vec4 paint_fish_metal(float u, float v) {
  const float side = static_cast<float>(smooth_step(0.28, 0.42, v));
  const float blotch = 0.05f * static_cast<float>(gradient_noise(u * 30, v * 12, 7, 9));
  const double du = (u - 0.105) * 3.0, dv = v - 0.40;
  if (du * du + dv * dv < 0.105 * 0.105) return Vec4(0, 0.05f, 0, 1);
  return Vec4(0, mix(0.42f, 0.27f, side) + blotch, mix(0.55f, 0.95f, side), 1);
}

}  // namespace shoal
