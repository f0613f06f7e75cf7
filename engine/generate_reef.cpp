#include "engine/generate_reef.h"

#include <algorithm>
#include <cmath>

#include "engine/math.h"
#include "engine/noise.h"

namespace shoal {
namespace {

struct Twig {
  Vec3 foot, way;
  float length, radius;
  int level;
};

constexpr uint32_t kTwigSegments = 5;
constexpr int kTwigLevels = 5;

}  // namespace

MeshData branch_coral(uint64_t triangles, uint32_t seed) {
  RandomStream random(seed, 31);
  // Two or three twigs from each: about 90 in all.
  const auto sides = static_cast<uint32_t>(std::clamp<uint64_t>(triangles / (90 * kTwigSegments * 2), 4, 64));
  MeshData mesh;
  std::vector<Twig> twigs = {{Vec3(0, -0.1f, 0), Vec3(0, 1, 0), 0.28f, 0.085f, 0}};
  for (size_t k = 0; k < twigs.size(); ++k) {
    const Twig twig = twigs[k];
    const Vec3 tip = twig.foot + twig.way * twig.length;
    std::vector<Vec3> points;
    std::vector<float> radii;
    const bool last = twig.level + 1 == kTwigLevels;
    for (uint32_t s = 0; s <= kTwigSegments; ++s) {
      const float t = static_cast<float>(s) / kTwigSegments;
      points.push_back(twig.foot + (tip - twig.foot) * t);
      // The last twigs end round, as tips do.
      const float close = last ? std::sqrt(std::max(0.0f, 1 - t * t * t * t * t * t)) : 1.0f;
      radii.push_back(twig.radius * (1 - 0.25f * t) * std::max(close, 0.02f) * (1 + 0.1f * random.uniform(-1, 1)));
    }
    mesh.append(tube(points, radii, sides));
    if (last) continue;
    const uint32_t forks = 2 + (random.uniform() < 0.45f ? 1 : 0);
    for (uint32_t f = 0; f < forks; ++f) {
      Vec3 way = glm::normalize(twig.way + random.unit_vector() * 0.75f + Vec3(0, 0.25f, 0));
      twigs.push_back({tip - twig.way * (twig.radius * 0.4f), way, twig.length * random.uniform(0.68f, 0.92f),
                       twig.radius * 0.76f, twig.level + 1});
    }
  }
  return mesh;
}

SpherePosition brain_coral(const Vec3& center, const Vec3& radii, uint32_t seed, uint32_t cells) {
  const int octaves = octaves_down_to(0.25, 1.6 / cells);
  return [=](const DVec3& unit) {
    const double warp = 0.35 * gradient_noise(unit.x * 2, unit.y * 2, unit.z * 2, seed + 5);
    const double maze = gradient_noise(unit.x * 6.5 + warp, unit.y * 6.5 + warp, unit.z * 6.5 - warp, seed);
    const double groove = smooth_step(0.02, 0.2, std::abs(maze));
    const double grain = 0.008 * fractal_noise(unit.x * 40, unit.y * 40, unit.z * 40, seed + 9, octaves);
    const double lobes = 0.1 * gradient_noise(unit.x * 1.5, unit.y * 1.5, unit.z * 1.5, seed + 1);
    const double radius = 1 + lobes + 0.07 * (groove - 1) + grain;
    return center + Vec3(unit * radius) * radii;
  };
}

MeshData starfish(uint32_t cells) {
  const uint32_t around = 10 * cells, rings = 3 * cells;
  MeshData mesh;
  for (uint32_t i = 0; i <= rings; ++i) {
    const float r = static_cast<float>(i) / static_cast<float>(rings);
    for (uint32_t j = 0; j <= around; ++j) {
      const float turn = static_cast<float>(j % around) / static_cast<float>(around);
      const SinCos angle = sin_cos(2 * kPi * turn);
      const SinCos arm = sin_cos(2 * kPi * 5 * turn);
      const float lobe = 0.5f + 0.5f * arm.cos;
      const float reach = 0.30f + 0.70f * lobe * lobe * (0.6f + 0.4f * lobe);
      const float bumps = 0.018f * sin_cos(40 * r + 11 * turn).sin * sin_cos(2 * kPi * 60 * turn).cos * r;
      const float ridge = (0.09f + 0.09f * (1 - r)) * (0.45f + 0.55f * lobe) + bumps;
      const float y = ridge * std::sqrt(std::max(0.0f, 1 - r * r * r * r)) - 0.03f;
      mesh.positions.push_back(Vec3(angle.cos * reach * r, y, angle.sin * reach * r));
      mesh.uvs.push_back({turn, r});
    }
  }
  for (uint32_t i = 0; i < rings; ++i) {
    for (uint32_t j = 0; j < around; ++j) {
      const uint32_t a = i * (around + 1) + j, c = a + around + 1;
      if (i > 0) mesh.add_triangle(a, a + 1, c + 1);
      mesh.add_triangle(a, c + 1, c);
    }
  }
  compute_normals(mesh);
  mesh.uvs.clear();
  return mesh;
}

MeshData curved_card(uint32_t cells, float curve) {
  MeshData mesh;
  for (uint32_t j = 0; j <= cells; ++j) {
    for (uint32_t i = 0; i <= cells; ++i) {
      const float u = static_cast<float>(i) / static_cast<float>(cells);
      const float v = static_cast<float>(j) / static_cast<float>(cells);
      const float x = u - 0.5f, y = 1 - v;
      mesh.positions.push_back(Vec3(x, y, curve * (x * x * 1.6f - 0.3f * y * y)));
      mesh.uvs.push_back({u, v});
    }
  }
  for (uint32_t j = 0; j < cells; ++j) {
    for (uint32_t i = 0; i < cells; ++i) {
      const uint32_t a = j * (cells + 1) + i, c = a + cells + 1;
      mesh.add_triangle(a, c, c + 1);
      mesh.add_triangle(a, c + 1, a + 1);
    }
  }
  return mesh;
}

MeshData kelp(uint32_t ribbons, float height, uint32_t seed) {
  RandomStream random(seed, 37);
  MeshData mesh;
  constexpr uint32_t kSegments = 28;
  for (uint32_t k = 0; k < ribbons; ++k) {
    const SinCos turn = sin_cos(2 * kPi * random.uniform());
    const Vec3 across = Vec3(turn.cos, 0, turn.sin) * random.uniform(0.11f, 0.17f);
    const Vec3 lean(random.uniform(-0.25f, 0.25f), 0, random.uniform(-0.25f, 0.25f));
    const float phase = random.uniform(), reach = height * random.uniform(0.6f, 1.0f);
    const Vec3 foot = random.unit_vector() * Vec3(0.3f, 0, 0.3f);
    const auto base = static_cast<uint32_t>(mesh.positions.size());
    for (uint32_t s = 0; s <= kSegments; ++s) {
      const float t = static_cast<float>(s) / kSegments;
      const SinCos wave = sin_cos(2 * kPi * (phase + 1.2f * t));
      const Vec3 p = foot + Vec3(0, reach * t, 0) + lean * (reach * t * t) +
                     Vec3(0.16f * wave.sin, 0, 0.10f * wave.cos) * (0.3f + t);
      const SinCos twist = sin_cos(2.2f * t + phase);
      const Vec3 side = across * twist.cos + Vec3(-across.z, 0, across.x) * twist.sin;
      const float v = 1 - 3 * t;  // the texture of leaves three times over the height
      mesh.positions.insert(mesh.positions.end(), {p - side, p + side});
      mesh.uvs.insert(mesh.uvs.end(), {Vec2(0, v), Vec2(1, v)});
    }
    for (uint32_t s = 0; s < kSegments; ++s) {
      mesh.add_triangle(base + 2 * s, base + 2 * s + 1, base + 2 * s + 3);
      mesh.add_triangle(base + 2 * s, base + 2 * s + 3, base + 2 * s + 2);
    }
  }
  return mesh;
}

MeshData sea_dome(float radius, const Vec3& gap, float gap_cosine) {
  constexpr uint32_t kAround = 72, kUp = 30;
  const Vec3 towards = glm::normalize(gap);
  MeshData mesh;
  std::vector<bool> open;
  for (uint32_t j = 0; j <= kUp; ++j) {
    const float v = static_cast<float>(j) / kUp;
    const SinCos polar = sin_cos(0.56f * kPi * v + 0.01f);
    for (uint32_t i = 0; i <= kAround; ++i) {
      const float u = static_cast<float>(i) / kAround;
      const SinCos turn = i == kAround ? SinCos{0, 1} : sin_cos(2 * kPi * u);
      const Vec3 way(-polar.sin * turn.sin, polar.cos, polar.sin * turn.cos);
      mesh.positions.push_back(way * radius);
      mesh.uvs.push_back({u, v});
      open.push_back(glm::dot(way, towards) > gap_cosine);
    }
  }
  for (uint32_t j = 0; j < kUp; ++j) {
    for (uint32_t i = 0; i < kAround; ++i) {
      const uint32_t a = j * (kAround + 1) + i, c = a + kAround + 1;
      if (open[a] || open[a + 1] || open[c] || open[c + 1]) continue;
      mesh.add_triangle(a, a + 1, c + 1);
      mesh.add_triangle(a, c + 1, c);
    }
  }
  return mesh;
}

}  // namespace shoal
