#include "engine/generate_plants.h"

#include <algorithm>
#include <cmath>

#include "engine/math.h"
#include "engine/noise.h"

namespace shoal {
namespace {

/// A leaf of two triangles folded along its rib.
void add_leaf(MeshData& mesh, const Vec3& foot, const Vec3& along, const Vec3& across, const Vec4& color) {
  const auto base = static_cast<uint32_t>(mesh.positions.size());
  const Vec3 fold = glm::cross(along, across) * (0.25f / std::max(1e-6f, glm::length(along)));
  mesh.positions.insert(mesh.positions.end(), {foot, foot + along * 0.55f + across + fold, foot + along,
                                               foot + along * 0.55f - across + fold});
  mesh.colors.insert(mesh.colors.end(), 4, color);
  mesh.add_triangle(base, base + 1, base + 2);
  mesh.add_triangle(base, base + 2, base + 3);
}

Vec4 leaf_color(RandomStream& random, const Vec3& dark, const Vec3& light) {
  const float mix = random.uniform();
  return Vec4(dark + (light - dark) * mix, 1);
}

/// Points from `from` towards `to`, bowed sideways.
std::vector<Vec3> limb(const Vec3& from, const Vec3& to, const Vec3& bow, uint32_t segments) {
  std::vector<Vec3> points;
  for (uint32_t k = 0; k <= segments; ++k) {
    const float t = static_cast<float>(k) / static_cast<float>(segments);
    points.push_back(from + (to - from) * t + bow * (4 * t * (1 - t)));
  }
  return points;
}

std::vector<float> tapering(float from, float to, uint32_t segments) {
  std::vector<float> radii;
  for (uint32_t k = 0; k <= segments; ++k) {
    radii.push_back(from + (to - from) * static_cast<float>(k) / static_cast<float>(segments));
  }
  return radii;
}

}  // namespace

Plant broadleaf_tree(uint64_t triangles, uint32_t seed) {
  RandomStream random(seed, 3);
  Plant plant;
  const bool fine = triangles > 1500;
  const uint32_t sides = fine ? 10 : 3, segments = fine ? 8 : 2, branches = fine ? 14 : 2;
  const Vec3 top(random.uniform(-0.4f, 0.4f), 4.6f, random.uniform(-0.4f, 0.4f));
  const std::vector<Vec3> trunk = limb(Vec3(0, -0.2f, 0), top, Vec3(0.15f, 0, 0.1f), segments);
  plant.wood = tube(trunk, tapering(0.26f, 0.07f, segments), sides);
  std::vector<Vec3> tips = {top};
  for (uint32_t k = 0; k < branches; ++k) {
    const Vec3 from = trunk[1 + (k * (trunk.size() - 1)) / branches % (trunk.size() - 1)];
    Vec3 way = random.unit_vector();
    way.y = std::abs(way.y) * 0.6f + 0.25f;
    const Vec3 tip = Vec3(from.x, std::max(from.y, 1.9f), from.z) + way * random.uniform(1.2f, 2.1f);
    plant.wood.append(tube(limb(Vec3(from.x, std::max(from.y, 1.7f), from.z), tip, Vec3(0, 0.15f, 0), segments / 2),
                           tapering(0.08f, 0.02f, segments / 2), std::max(3u, sides - 3)));
    tips.push_back(tip);
  }
  const uint64_t wood = plant.wood.triangles_count();
  const uint64_t leaves = triangles > wood ? (triangles - wood) / 2 : 2;
  // The leaves' area stays about the same until they reach 3 cm.
  const float size = std::max(0.03f, std::sqrt(52.0f / static_cast<float>(leaves)));
  for (uint64_t k = 0; k < leaves; ++k) {
    const Vec3 out = random.unit_vector();
    const float radius = 1 - random.uniform() * random.uniform();
    const Vec3 foot = tips[k % tips.size()] + out * (1.25f * radius) * Vec3(1, 0.75f, 1);
    const Vec3 along = glm::normalize(out + random.unit_vector() * 0.8f - Vec3(0, 0.4f, 0)) * size;
    const Vec3 across = glm::cross(along, random.unit_vector()) * 0.45f;
    add_leaf(plant.leaves, foot, along, across, leaf_color(random, {0.10f, 0.22f, 0.04f}, {0.34f, 0.44f, 0.08f}));
  }
  return plant;
}

Plant conifer_tree(uint64_t triangles, uint32_t seed) {
  RandomStream random(seed, 4);
  Plant plant;
  const bool fine = triangles > 1000;
  const uint32_t sides = fine ? 9 : 3, segments = fine ? 8 : 2;
  plant.wood = tube(limb(Vec3(0, -0.2f, 0), Vec3(0, 7.4f, 0), Vec3(0.05f, 0, 0), segments),
                    tapering(0.2f, 0.02f, segments), sides);
  const uint64_t wood = plant.wood.triangles_count();
  const uint64_t needles = triangles > wood ? (triangles - wood) / 2 : 2;
  const float size = std::max(0.05f, std::sqrt(56.0f / static_cast<float>(needles)));
  const uint32_t whorls = 22;
  for (uint64_t k = 0; k < needles; ++k) {
    const float whorl = static_cast<float>(random.below(whorls)) / static_cast<float>(whorls);
    const float height = 0.9f + 6.4f * whorl;
    const float reach = 2.0f * (1 - whorl) * (0.92f + 0.16f * random.uniform()) + 0.12f;
    // 7 boughs a whorl, turned from whorl to whorl; needles thicken towards the tip.
    const float turn = 2 * kPi * (static_cast<float>(random.below(7)) / 7.0f + whorl * 5.3f);
    const SinCos angle = sin_cos(turn + random.uniform(-0.16f, 0.16f));
    const float out = reach * std::sqrt(0.04f + 0.96f * random.uniform());
    const Vec3 foot(angle.cos * out, height - 0.28f * out * out / std::max(reach, 0.3f) + 0.06f * random.uniform(),
                    angle.sin * out);
    const Vec3 along =
        glm::normalize(Vec3(angle.cos, -0.25f, angle.sin) + random.unit_vector() * 0.7f) * size * 1.3f;
    const Vec3 across = glm::normalize(glm::cross(along, random.unit_vector()) + Vec3(1e-4f, 0, 0)) * (size * 0.2f);
    add_leaf(plant.leaves, foot, along, across, leaf_color(random, {0.03f, 0.10f, 0.05f}, {0.10f, 0.22f, 0.09f}));
  }
  return plant;
}

Plant card_bush(uint64_t triangles, uint32_t seed) {
  RandomStream random(seed, 5);
  Plant plant;
  const uint64_t cards = std::max<uint64_t>(2, triangles / 2);
  const float size = std::max(0.07f, std::sqrt(9.0f / static_cast<float>(cards)));
  for (uint64_t k = 0; k < cards; ++k) {
    Vec3 out = random.unit_vector();
    out.y = std::abs(out.y);
    const Vec3 up = glm::normalize(out + random.unit_vector() * 0.6f);
    const Vec3 across = glm::normalize(glm::cross(up, random.unit_vector()) + Vec3(1e-4f, 0, 0));
    const Vec3 center = out * Vec3(0.95f, 0.8f, 0.95f) * (0.45f + 0.5f * random.uniform());
    plant.leaves.append(rectangle(center, across * size * 0.5f, up * size * 0.5f));
  }
  return plant;
}

Plant fern(uint64_t triangles, uint32_t seed) {
  RandomStream random(seed, 6);
  Plant plant;
  const auto segments = static_cast<uint32_t>(std::clamp<uint64_t>(triangles / 24, 1, 24));
  const uint64_t fronds = std::max<uint64_t>(2, triangles / (2 * segments));
  const float width = 0.16f / (1 + static_cast<float>(fronds) / 400);
  for (uint64_t k = 0; k < fronds; ++k) {
    const SinCos angle = sin_cos(2 * kPi * random.uniform());
    const Vec3 out(angle.cos, 0, angle.sin), across(-angle.sin, 0, angle.cos);
    const float reach = random.uniform(0.5f, 0.95f), rise = random.uniform(0.45f, 0.8f);
    const auto base = static_cast<uint32_t>(plant.leaves.positions.size());
    for (uint32_t s = 0; s <= segments; ++s) {
      const float t = static_cast<float>(s) / static_cast<float>(segments);
      const Vec3 p = out * (reach * t) + Vec3(0, rise * (1.9f * t - 1.35f * t * t), 0);
      plant.leaves.positions.insert(plant.leaves.positions.end(), {p - across * width, p + across * width});
      plant.leaves.uvs.insert(plant.leaves.uvs.end(), {Vec2(0, 1 - t), Vec2(1, 1 - t)});
    }
    for (uint32_t s = 0; s < segments; ++s) {
      plant.leaves.add_triangle(base + 2 * s, base + 2 * s + 1, base + 2 * s + 3);
      plant.leaves.add_triangle(base + 2 * s, base + 2 * s + 3, base + 2 * s + 2);
    }
  }
  return plant;
}

Plant grass_tuft(uint64_t triangles, uint32_t seed) {
  RandomStream random(seed, 7);
  Plant plant;
  const uint64_t blades = std::max<uint64_t>(1, triangles / 2);
  const float width = std::max(0.004f, 0.03f / (1 + static_cast<float>(blades) / 300));
  for (uint64_t k = 0; k < blades; ++k) {
    const Vec3 way = random.unit_vector();
    const Vec3 foot = Vec3(way.x, 0, way.z) * 0.55f * std::sqrt(random.uniform());
    const Vec3 along = Vec3(way.x * 0.4f, 1, way.z * 0.4f) * random.uniform(0.18f, 0.5f);
    const Vec3 across = glm::normalize(glm::cross(along, random.unit_vector()) + Vec3(1e-4f, 0, 0)) * width;
    add_leaf(plant.leaves, foot, along, across, leaf_color(random, {0.16f, 0.26f, 0.05f}, {0.52f, 0.50f, 0.16f}));
  }
  return plant;
}

}  // namespace shoal
