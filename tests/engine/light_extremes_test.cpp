// The tree over lights that are few, many, in one place, in a line, of no size, or of sizes and powers as far apart as
// floats allow; and lights with a range.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "engine/build_light_tree.h"
#include "engine/cluster_lights.h"
#include "engine/light_sampler.h"
#include "engine/tree_lights.h"
#include "tests/support/sample_soups.h"
#include "tests/support/shading_scene.h"

namespace shoal {
namespace {

using namespace testing;

PunctualLight point_light(const Vec3& at, float range = 0) {
  PunctualLight light{PunctualType::kPoint, {at.x, at.y, at.z}, {0, 0, -1}, {1, 1, 1}, 1, 0};
  light.range = range;
  return light;
}
TreeLight triangle(const Vec3& at, const Vec3& a, const Vec3& b, double strength, uint32_t index) {
  Emitter e{};
  const Vec3 corners[3] = {at, at + a, at + b};
  for (int k = 0; k < 9; ++k) e.position[k] = corners[k / 3][k % 3];
  return tree_light(e, strength, index);
}
Vec3 in_cube(Numbers& numbers) { return {numbers.uniform(-1, 1), numbers.uniform(-1, 1), numbers.uniform(-1, 1)}; }

/// Draws and chances agree and are numbers; those of all lights sum to one, or to less where some draws find none.
void expect_sound(std::vector<TreeLight> lights, const std::vector<Vec3>& places, bool all_reach) {
  const uint32_t count = static_cast<uint32_t>(lights.size());
  const LightTree tree = build_light_tree(std::move(lights), count, 1);
  Numbers numbers(6);
  for (const Vec3& at : places) {
    const LightReceiver receiver{at, all_reach ? 0 : encode_direction(glm::normalize(in_cube(numbers)))};
    double sum = 0;
    for (uint32_t light = 0; light < count; ++light) {
      const double chance = tree.chance(receiver, light);
      ASSERT_TRUE(chance >= 0 && chance <= 1) << chance;
      sum += chance;
    }
    if (all_reach) {
      EXPECT_NEAR(sum, 1, 1e-9) << count;
    } else {
      EXPECT_LE(sum, 1 + 1e-9) << count;
    }
    for (int i = 0; i < 200; ++i) {
      const LightTree::Choice choice = tree.sample(receiver, (i + 0.5) / 200);
      if (!(choice.chance > 0)) {
        EXPECT_LT(sum, 1 - 1e-9) << "so there is room for it";
        continue;
      }
      ASSERT_LT(choice.light, count);
      ASSERT_TRUE(choice.remainder >= 0 && choice.remainder < 1);
      ASSERT_DOUBLE_EQ(choice.chance, tree.chance(receiver, choice.light));
    }
  }
}

std::vector<Vec3> places(float scale) {
  Numbers numbers(2);
  std::vector<Vec3> all;
  for (int i = 0; i < 10; ++i) all.push_back(in_cube(numbers) * scale);
  return all;
}

TEST(LightExtremes, OneToThreeLightsApartAndInOnePlace) {
  for (const bool apart : {false, true}) {
    for (uint32_t count = 1; count <= 3; ++count) {
      std::vector<TreeLight> points, triangles;
      for (uint32_t i = 0; i < count; ++i) {
        const Vec3 at(apart ? static_cast<float>(i) : 0.0f, 0.5f, 0.25f);
        points.push_back(tree_light(point_light(at), 1, i));
        triangles.push_back(triangle(at, {0, 1e-3f, 0}, {1e-3f, 0, 0}, 1, i));
      }
      expect_sound(points, places(2), true);
      expect_sound(triangles, places(2), false);
    }
  }
}

TEST(LightExtremes, LightsInAPlaneAndInALine) {
  for (const bool line : {false, true}) {
    Numbers numbers(3);
    std::vector<TreeLight> points, triangles;
    for (uint32_t i = 0; i < 700; ++i) {
      const Vec3 at(numbers.uniform(-1, 1), line ? 0.0f : numbers.uniform(-1, 1), 0);
      points.push_back(tree_light(point_light(at), 1, i));
      triangles.push_back(triangle(at, {0, 0.01f, 0}, {0.01f, 0, 0}, 1, i));
    }
    expect_sound(points, places(2), true);
    expect_sound(triangles, places(2), false);
    expect_sound(triangles, {{0, 0, 0}, {0.5f, 0, 0}, {5, 0, 0}}, false);  // in the plane of all of them
  }
}

TEST(LightExtremes, SizesAndPowersAsFarApartAsFloats) {
  std::vector<TreeLight> points, triangles;
  for (uint32_t i = 0; i < 300; ++i) {
    const float size = std::ldexp(1.0f, static_cast<int>(i % 200) - 100);  // 1e-30 to 1e30
    const double strength = i % 3 == 0 ? 1 : 1e-60;
    points.push_back(tree_light(point_light({size, -size, 0}), strength, i));
    triangles.push_back(triangle({-size, 0, size}, {0, size, 0}, {size, 0, 0}, strength, i));
  }
  points.push_back(tree_light(point_light(Vec3(std::numeric_limits<float>::max())), 1, 300));
  points.push_back(tree_light(point_light(Vec3(-std::numeric_limits<float>::max())), 1e-60, 301));
  for (const float scale : {0.0f, 1e-35f, 1e-3f, 1.0f, 1e10f, 1e30f}) {
    expect_sound(points, places(scale), true);
    expect_sound(triangles, places(scale), false);
  }
}

TEST(LightExtremes, AHundredThousandInOnePlaceBesideOneFarAway) {
  std::vector<TreeLight> lights;
  for (uint32_t i = 0; i < 100000; ++i) lights.push_back(tree_light(point_light({1, 2, 3}), 1, i));
  lights.push_back(tree_light(point_light({1e30f, 0, 0}), 1, 100000));
  const LightTree tree = build_light_tree(std::move(lights), 100001, 2);
  const LightReceiver receiver{{1, 2, 4}, 0};
  for (const uint32_t light : {0u, 5u, 77777u, 99999u}) EXPECT_NEAR(tree.chance(receiver, light), 1e-5, 1e-6);
  EXPECT_LT(tree.chance(receiver, 100000), 1e-30);
}

/// So many that clusters of them have more than one.
TEST(LightExtremes, ManyLightsInClustersHaveTheirChances) {
  constexpr uint32_t kCount = 70000;
  ASSERT_GT(cluster_size(kCount), 4u);
  Numbers numbers(4);
  std::vector<TreeLight> lights;
  for (uint32_t i = 0; i < kCount; ++i) {
    const Vec3 a = 0.01f * in_cube(numbers), b = glm::cross(a, in_cube(numbers));
    lights.push_back(triangle(in_cube(numbers), a, b, numbers.uniform(0.01f, 1), i));
  }
  const std::vector<TreeLight> given = lights;
  const LightTree one = build_light_tree(lights, kCount, 1), three = build_light_tree(lights, kCount, 3);
  for (const Vec3& at : places(1.5f)) {
    const LightReceiver receiver{at, encode_direction(glm::normalize(in_cube(numbers)))};
    double sum = 0, none = 0;
    const Vec3 normal(decode_direction(receiver.side));
    for (uint32_t i = 0; i < kCount; ++i) {
      const double chance = one.chance(receiver, i);
      ASSERT_EQ(chance, three.chance(receiver, i));
      const Vec3 corner(given[i].hi[0], given[i].hi[1], given[i].hi[2]);
      if (chance == 0) { ASSERT_LT(glm::dot(normal, corner - at), 0.05f) << "above the surface"; }
      sum += chance;
    }
    for (int k = 0; k < 4000; ++k) none += one.sample(receiver, (k + 0.5) / 4000).chance > 0 ? 0 : 1.0 / 4000;
    EXPECT_NEAR(sum + none, 1, none == 0 ? 1e-9 : 0.01);
  }
}

TEST(LightExtremes, ClustersHoldEveryLightOnce) {
  for (const uint32_t most : {1u, 5u, kLargestCluster}) {
    Numbers numbers(5);
    std::vector<TreeLight> lights;
    for (uint32_t i = 0; i < 3000; ++i) {
      lights.push_back(tree_light(point_light(i < 1000 ? Vec3(0.5f) : in_cube(numbers)), 1, i));
    }
    const std::vector<LightCluster> clusters = cluster_lights(lights, most);
    std::vector<int> seen(lights.size());
    for (const TreeLight& light : lights) ++seen[light.light];
    for (const int times : seen) EXPECT_EQ(times, 1);
    uint32_t next = 0, large = 0;
    for (size_t i = 0; i < clusters.size(); ++i) {
      EXPECT_EQ(clusters[i].first, next);
      EXPECT_EQ(clusters[i].sums.square[3], static_cast<float>(clusters[i].count));
      next += clusters[i].count;
      large += clusters[i].count > most ? 1 : 0;
      if (i > 0) { EXPECT_GT(clusters[i].count + clusters[i - 1].count, most); }
    }
    EXPECT_EQ(next, lights.size());
    EXPECT_LE(large, most == 1 ? 10u : 1u) << "those in one place";
  }
}

TEST(LightExtremes, NoLightIsChosenBeyondItsRange) {
  Numbers numbers(7);
  std::vector<TreeLight> lights;
  std::vector<PunctualLight> given;
  for (uint32_t i = 0; i < 500; ++i) {
    given.push_back(point_light(in_cube(numbers), numbers.uniform(0.05f, 1)));
    lights.push_back(tree_light(given[i], 1, i));
  }
  const LightTree tree = build_light_tree(std::move(lights), 500, 1);
  for (int k = 0; k < 200; ++k) {
    const LightReceiver receiver{in_cube(numbers) * 1.5f, 0};
    double sum = 0;
    uint32_t reaching = 0;
    for (uint32_t i = 0; i < 500; ++i) {
      const PunctualLight& light = given[i];
      const Vec3 at(light.position[0], light.position[1], light.position[2]);
      const float distance = glm::length(receiver.position - at);
      const double chance = tree.chance(receiver, i);
      if (distance < light.range) {
        EXPECT_GT(chance, 0), ++reaching;
      } else if (distance > 1.001f * light.range) {
        EXPECT_EQ(chance, 0);
      }
      sum += chance;
    }
    EXPECT_LE(sum, 1 + 1e-9);
    if (reaching > 0) { EXPECT_GT(sum, 0); }
  }
  EXPECT_EQ(tree.sample({{10, 10, 10}, 0}, 0.5).chance, 0);
}

TEST(LightSampler, RangeEndsLightAsKhrLightsPunctualRecommends) {
  for (const bool in_tree : {false, true}) {
    ShadingScene s(random_soup(1, 0.1f, 1), {matte(Vec3(1))});
    s.scene.lights.assign(in_tree ? 3 : 1, point_light({0, 0, 0}, 2));
    const Environment none;
    const LightSampler lights(s.scene, none);
    ASSERT_EQ(lights.has_tree(), in_tree);
    for (const float distance : {0.5f, 1.0f, 1.5f, 1.99f, 2.01f, 3.0f}) {
      const LightReceiver receiver{{distance, 0, 0}, 0};
      const LightSample sample = lights.sample(receiver.position, receiver, {0.5, 0.5, 0.5});
      const double ratio = distance / 2, expected = std::max(0.0, 1 - std::pow(ratio, 4)) / (distance * distance);
      const double found = sample.pdf > 0 ? sample.radiance.x / sample.pdf : 0.0;
      EXPECT_NEAR(found, expected * static_cast<double>(s.scene.lights.size()), 1e-5 * expected) << distance;
    }
  }
}

/// A scene whose lamps are of no area, of a texture that is not a number, or as far apart in size as floats.
TEST(LightSampler, LampsThatAreNoLightsAreLeftOutOfAMillion) {
  ShadingScene s(random_soup(4, 0.1f, 1), {lamp(Vec3(1)), lamp(Vec3(1)), lamp(Vec3(1))});
  s.scene.materials[1].emission_weight = std::nanf("");
  s.scene.materials[2].emission_weight = std::numeric_limits<float>::infinity();
  Emitter flat = s.scene.emitters[0];
  for (int k = 3; k < 9; ++k) flat.position[k] = flat.position[k % 3];
  flat.material = 0;
  s.scene.emitters.assign(1000000, flat);
  for (uint32_t i = 0; i < s.scene.emitters.size(); ++i) {
    s.scene.emitters[i].primitive = i;
    s.scene.emitters[i].material = i % 3;
    if (i % 3 > 0) s.scene.emitters[i].position[4] += 1, s.scene.emitters[i].position[8] += 1;
  }
  const Environment none;
  const LightSampler nothing(s.scene, none);
  EXPECT_FALSE(nothing.has_tree());
  EXPECT_TRUE(nothing.empty());

  // Three among them are lights, 1e60 apart in size.
  for (const uint32_t i : {10u, 500000u, 999999u}) {
    const float size = i == 10 ? 1e-18f : i == 500000 ? 1.0f : 1e18f;
    const float corners[9] = {0, 0, 0, size, 0, 0, 0, size, 0};
    std::copy_n(corners, 9, s.scene.emitters[i].position);
    s.scene.emitters[i].material = 0;
  }
  const LightSampler three(s.scene, none);
  ASSERT_TRUE(three.has_tree());
  for (const float height : {1e-19f, 1.0f, 1e17f}) {
    const LightReceiver receiver{{0.2f * height, 0.2f * height, height}, encode_direction({0, 0, -1})};
    for (int i = 0; i < 100; ++i) {
      const double u = (i + 0.5) / 100;
      const LightSample sample = three.sample(receiver.position, receiver, {u, u, 1 - u});
      EXPECT_TRUE(std::isfinite(sample.pdf) && sample.pdf >= 0);
      EXPECT_TRUE(std::isfinite(sample.direction.x) && std::isfinite(sample.radiance.x));
    }
  }
}

}  // namespace
}  // namespace shoal
