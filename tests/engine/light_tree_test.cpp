// The tree over many lights: its chances, its bounds, its shape, and pictures lit through it.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "engine/build_light_tree.h"
#include "engine/light_sampler.h"
#include "engine/math.h"
#include "engine/tree_lights.h"
#include "tests/support/sample_soups.h"
#include "tests/support/shading_scene.h"

namespace shoal {
namespace {

using namespace testing;

Vec3 point_in_cube(Numbers& numbers) {
  return {numbers.uniform(-2, 2), numbers.uniform(-2, 2), numbers.uniform(-2, 2)};
}
Vec3 direction(Numbers& numbers) {
  for (;;) {
    const Vec3 d(numbers.uniform(-1, 1), numbers.uniform(-1, 1), numbers.uniform(-1, 1));
    const float length = glm::length(d);
    if (length > 0.1f && length < 1) return d / length;
  }
}

/// `count` small lamps in the unit cube, and `count` / 2 point lights and spots between them.
struct ManyLights : ShadingScene {
  explicit ManyLights(uint32_t count, float size = 0.05f, uint64_t seed = 1)
      : ShadingScene(random_soup(count, size, seed), {lamp(Vec3(2, 1, 3)), lamp(Vec3(1)), lamp(Vec3(5))}) {
    Numbers numbers(seed + 100);
    for (uint32_t i = 0; i < count / 2; ++i) {
      PunctualLight light{};
      light.type = i % 2 == 0 ? PunctualType::kPoint : PunctualType::kSpot;
      const Vec3 at(numbers.uniform(0, 1), numbers.uniform(0, 1), numbers.uniform(0, 1)), to = direction(numbers);
      for (int c = 0; c < 3; ++c) {
        light.position[c] = at[c], light.direction[c] = to[c];
        light.intensity[c] = numbers.uniform(0.001f, 0.01f);
      }
      light.cos_outer = numbers.uniform(0, 0.99f), light.cos_inner = numbers.uniform(light.cos_outer, 1);
      scene.lights.push_back(light);
    }
  }

  size_t light_count() const { return scene.emitters.size() + scene.lights.size(); }

  LightTree tree(unsigned threads = 1) const {
    std::vector<TreeLight> lights;
    uint32_t index = 0;
    for (const Emitter& e : scene.emitters) lights.push_back(tree_light(e, emitter_area(e), index++));
    for (const PunctualLight& l : scene.lights) lights.push_back(tree_light(l, l.intensity[0], index++));
    return build_light_tree(std::move(lights), index, threads);
  }
};

LightReceiver random_receiver(Numbers& numbers) {
  const Vec3 at = point_in_cube(numbers);
  return {at, numbers.below(4) == 0 ? 0 : encode_direction(direction(numbers))};
}

TEST(DirectionCode, IsWithinItsError) {
  Numbers numbers(5);
  std::vector<Vec3> directions{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1},
                               glm::normalize(Vec3(-1e-8f, -1e-8f, -1)), glm::normalize(Vec3(1, -1e-6f, -1))};
  for (int i = 0; i < 20000; ++i) directions.push_back(direction(numbers));
  for (const Vec3& d : directions) {
    const uint32_t code = encode_direction(d);
    ASSERT_NE(code, 0u);
    const glm::dvec3 back = decode_direction(code);
    EXPECT_NEAR(glm::length(back), 1, 1e-12);
    EXPECT_LE(glm::length(glm::cross(back, glm::dvec3(d))), kDirectionCodeError);
    EXPECT_GT(glm::dot(back, glm::dvec3(d)), 0);
  }
  EXPECT_EQ(encode_direction(Vec3(0)), 0u);
  EXPECT_EQ(encode_direction(Vec3(std::nanf(""), 0, 1)), 0u);
}

TEST(LightTree, ChancesOfAllLightsAndOfNoneSumToOne) {
  for (const uint32_t count : {2u, 3u, 5u, 17u, 400u}) {
    const ManyLights s(count);
    const LightTree tree = s.tree();
    Numbers numbers(count);
    int whole = 0;
    for (int i = 0; i < 50; ++i) {
      const LightReceiver receiver = random_receiver(numbers);
      double sum = 0;
      for (uint32_t light = 0; light < s.light_count(); ++light) sum += tree.chance(receiver, light);
      // Every light has one stretch of [0, 1); so has every place in the tree where no light is found.
      constexpr int kDraws = 4000;
      double none = 0;
      for (int k = 0; k < kDraws; ++k) none += tree.sample(receiver, (k + 0.5) / kDraws).chance > 0 ? 0 : 1;
      EXPECT_LE(sum, 1 + 1e-9);
      EXPECT_NEAR(sum + none / kDraws, 1, none == 0 ? 1e-9 : 0.01) << count << " lights";
      whole += none == 0 ? 1 : 0;
    }
    EXPECT_GT(whole, count < 100 ? 5 : -1) << "so their sum was seen to be one";
  }
}

TEST(LightTree, DrawsWithTheChancesItSays) {
  const ManyLights s(40);
  const LightTree tree = s.tree();
  Numbers numbers(9);
  for (int place = 0; place < 8; ++place) {
    const LightReceiver receiver = random_receiver(numbers);
    constexpr int kDraws = 20000;
    std::vector<int> counts(s.light_count());
    for (int i = 0; i < kDraws; ++i) {
      const LightTree::Choice choice = tree.sample(receiver, (i + 0.5) / kDraws);
      if (!(choice.chance > 0)) continue;
      ASSERT_TRUE(choice.remainder >= 0 && choice.remainder < 1);
      ASSERT_DOUBLE_EQ(choice.chance, tree.chance(receiver, choice.light));
      ++counts[choice.light];
    }
    // Draws are evenly spread, and each light takes one stretch of them: its count is known to within two.
    for (uint32_t light = 0; light < counts.size(); ++light) {
      EXPECT_NEAR(counts[light], tree.chance(receiver, light) * kDraws, 2.0);
    }
    // With independent numbers, chi-square over the lights that are expected at least 5 times.
    double chi2 = 0, cells = 0;
    std::vector<int> drawn(s.light_count());
    for (int i = 0; i < kDraws; ++i) {
      const LightTree::Choice choice = tree.sample(receiver, static_cast<double>(numbers.next() >> 11) * 0x1p-53);
      if (choice.chance > 0) ++drawn[choice.light];
    }
    for (uint32_t light = 0; light < drawn.size(); ++light) {
      const double expected = tree.chance(receiver, light) * kDraws;
      if (expected >= 5) chi2 += (drawn[light] - expected) * (drawn[light] - expected) / expected, ++cells;
    }
    EXPECT_LT(chi2, cells + 6 * std::sqrt(2 * cells) + 6);
  }
}

/// Whether a light sends anything to a place, on the side given.
bool reaches(const ManyLights& s, uint32_t light, const Vec3& at, const Vec3& normal) {
  if (light >= s.scene.emitters.size()) {
    const PunctualLight& p = s.scene.lights[light - s.scene.emitters.size()];
    const Vec3 way = at - Vec3(p.position[0], p.position[1], p.position[2]);
    if (!(glm::dot(normal, way) <= 0)) return normal == Vec3(0) ? p.type == PunctualType::kPoint : false;
    const float cosine = glm::dot(glm::normalize(way), Vec3(p.direction[0], p.direction[1], p.direction[2]));
    return p.type == PunctualType::kPoint || cosine > p.cos_outer;
  }
  const Emitter& e = s.scene.emitters[light];
  bool above = false;
  for (int k = 0; k < 3; ++k) {
    above = above || glm::dot(normal, Vec3(e.position[3 * k], e.position[3 * k + 1], e.position[3 * k + 2]) - at) > 0;
  }
  return above || normal == Vec3(0);
}

TEST(LightTree, NoLightThatReachesAPlaceHasChanceZero) {
  for (const float size : {1e-6f, 0.02f, 0.5f}) {
    const ManyLights s(60, size);
    const LightTree tree = s.tree();
    Numbers numbers(3);
    int zero = 0;
    for (int i = 0; i < 2000; ++i) {
      // Among the lights, and outside; sometimes at a corner of an emitter.
      Vec3 at = point_in_cube(numbers);
      if (i % 3 == 0) at = 0.3f * at + Vec3(0.5f);
      const Emitter& near = s.scene.emitters[numbers.below(60)];
      if (i % 7 == 0) at = {near.position[0], near.position[1], near.position[2]};
      Vec3 normal = direction(numbers);
      if (i % 5 == 0) normal = Vec3(0);
      const LightReceiver receiver{at, encode_direction(normal)};
      for (uint32_t light = 0; light < s.light_count(); ++light) {
        const bool none = tree.chance(receiver, light) == 0;
        zero += none ? 1 : 0;
        ASSERT_FALSE(none && reaches(s, light, at, normal)) << "light " << light << ", size " << size << ", place " << i;
      }
    }
    EXPECT_GT(zero, 1000) << "bounds that leave nothing out prove nothing";
  }
}

TEST(LightTree, IsTheSameForAnyNumberOfThreads) {
  const ManyLights s(30000, 0.01f);
  const LightTree one = s.tree(1), three = s.tree(3);
  Numbers numbers(4);
  for (int i = 0; i < 300; ++i) {
    const LightReceiver receiver = random_receiver(numbers);
    const double u = static_cast<double>(numbers.next() >> 11) * 0x1p-53;
    const LightTree::Choice a = one.sample(receiver, u), b = three.sample(receiver, u);
    ASSERT_EQ(a.light, b.light);
    ASSERT_EQ(a.chance, b.chance);
    ASSERT_EQ(a.remainder, b.remainder);
  }
}

TEST(LightTree, LightsInOnePlaceAndInALineAreTold) {
  Numbers numbers(8);
  for (const bool line : {false, true}) {
    std::vector<TreeLight> lights;
    for (uint32_t i = 0; i < 500; ++i) {
      PunctualLight light{PunctualType::kPoint, {0, 0, 0}, {0, 0, -1}, {1, 1, 1}, 1, 0};
      if (line) light.position[1] = std::ldexp(1.0f, static_cast<int>(i % 240) - 120);  // as far apart as floats are
      lights.push_back(tree_light(light, 1, i));
    }
    const LightTree tree = build_light_tree(std::move(lights), 500, 1);
    for (int i = 0; i < 20; ++i) {
      const LightReceiver receiver{point_in_cube(numbers), 0};
      double sum = 0;
      for (uint32_t light = 0; light < 500; ++light) sum += tree.chance(receiver, light);
      EXPECT_NEAR(sum, 1, 1e-9);
      EXPECT_GT(tree.chance(receiver, 3), 0);
    }
  }
}

TEST(LightTree, TheNearAndTheFacingAreChosenMost) {
  std::vector<TreeLight> lights;
  for (uint32_t i = 0; i < 100; ++i) {
    const PunctualLight light{PunctualType::kPoint, {static_cast<float>(i), 1, 0}, {0, 0, -1}, {1, 1, 1}, 1, 0};
    lights.push_back(tree_light(light, 1, i));
  }
  const LightTree tree = build_light_tree(std::move(lights), 100, 1);
  const LightReceiver receiver{{30, 0.9f, 0}, encode_direction({0, 1, 0})};
  EXPECT_GT(tree.chance(receiver, 30), 0.3);
  EXPECT_LT(tree.chance(receiver, 90), 0.001);
  EXPECT_EQ(tree.chance({{30, 5, 0}, encode_direction({0, 1, 0})}, 30), 0) << "below the surface";
}

TEST(LightSampler, LightsThatGiveNothingAreNotInTheTree) {
  ManyLights s(50);
  const size_t first_light = s.scene.emitters.size();
  // No area, no number, hidden by coverage, black, and one of 1e-12.
  std::fill_n(s.scene.emitters[0].position, 9, 0.25f);
  s.scene.emitters[1].position[4] = std::numeric_limits<float>::infinity();
  s.scene.materials.push_back(lamp(Vec3(1)));
  s.scene.materials.back().coverage = CoverageMode::kBlend;
  s.scene.emitters[2].material = 3;
  s.scene.lights[0].intensity[0] = s.scene.lights[0].intensity[1] = s.scene.lights[0].intensity[2] = 0;
  s.scene.lights[2].intensity[1] = std::nanf("");
  Emitter& tiny = s.scene.emitters[3];
  const float small[9] = {0.5f, 0.5f, 0.5f, 0.5f + 0x1p-20f, 0.5f, 0.5f, 0.5f, 0.5f + 0x1p-20f, 0.5f};
  std::copy_n(small, 9, tiny.position);
  EXPECT_NEAR(emitter_area(tiny), 4.5e-13, 1e-13);
  const Environment none;
  const LightSampler lights(s.scene, none);
  ASSERT_TRUE(lights.has_tree());
  const LightReceiver receiver{{0.5f, 0.5f, 0.6f}, 0};
  for (const size_t i : {0, 1, 2}) {
    const Hit hit{0, s.scene.emitters[i].primitive, 0, 0};
    EXPECT_EQ(lights.emitter_pdf(s.scene.materials[s.scene.emitters[i].material], hit, receiver), 0) << i;
  }
  EXPECT_GT(lights.emitter_pdf(s.scene.materials[0], {0, tiny.primitive, 0, 0}, receiver), 0);
  EXPECT_EQ(lights.emitter_pdf(s.scene.materials[0], {0, 1, 0, 0}, receiver), 0) << "no emitter";
  EXPECT_EQ(lights.emitter_pdf(s.scene.materials[0], {7, tiny.primitive, 0, 0}, receiver), 0) << "no such instance";
  for (uint32_t i = 0; i < 20000; ++i) {
    const Random4 r = random4(1, i, 0, 0, Dimension::kLight);
    const LightSample sample = lights.sample(receiver.position, receiver, {r.uniform(0), r.uniform(1), r.uniform(2)});
    if (!(sample.pdf > 0)) continue;
    EXPECT_TRUE(std::isfinite(sample.pdf));
    if (sample.emitter != nullptr) {
      EXPECT_GE(sample.emitter - s.scene.emitters.data(), 3);
    } else {
      EXPECT_GT(sample.radiance.x, 0);
    }
  }
  EXPECT_EQ(s.scene.emitters.size(), first_light);
}

TEST(LightSampler, ResidentBytesAreNoMoreThanPlanned) {
  for (const uint32_t count : {0u, 1u, 2u, 3u, 1000u}) {
    const ManyLights s(count);
    const Environment none;
    const LightSampler lights(s.scene, none);
    EXPECT_LE(lights.resident_bytes(), LightSampler::bytes_at_most(s.scene.emitters.size(), s.scene.lights.size()).resident);
    EXPECT_EQ(lights.has_tree(), s.light_count() > LightSampler::kFewLights);
  }
}

/// A floor under many lamps, some textured, with point lights between and a wall.
TriangleSoup lit_floor() {
  TriangleSoup soup;
  soup.layout.uv_count = 1;
  const auto add = [&soup](const Vec3& corner, const Vec3& a, const Vec3& b, uint32_t material) {
    add_rectangle(soup, corner, a, b, material);
    for (const Vec2& uv : {Vec2(0, 0), Vec2(1, 0), Vec2(1, 1), Vec2(0, 0), Vec2(1, 1), Vec2(0, 1)}) {
      std::vector<float> corner_floats(soup.layout.floats(), 0.0f);
      corner_floats[soup.layout.uv_offset(0)] = uv.x, corner_floats[soup.layout.uv_offset(0) + 1] = uv.y;
      soup.corners.insert(soup.corners.end(), corner_floats.begin(), corner_floats.end());
    }
  };
  Numbers numbers(12);
  add({-5, 0, -5}, {0, 0, 10}, {10, 0, 0}, 0);
  add({-1, 0, -5}, {0, 2, 0}, {0, 0, 10}, 0);
  for (uint32_t i = 0; i < 60; ++i) {
    const Vec3 a = direction(numbers) * 0.3f, b = glm::cross(direction(numbers), a);
    add({numbers.uniform(-5, 5), numbers.uniform(0.3f, 3), numbers.uniform(-5, 5)}, a, b, 1 + i % 2);
  }
  return soup;
}

struct LitFloor : ShadingScene {
  LitFloor() : ShadingScene(lit_floor(), {matte(Vec3(0.8f)), lamp(Vec3(3)), lamp(Vec3(4, 2, 1))}) {
    scene.materials[0].specular = 1, scene.materials[0].roughness = 0.3f;
    // Half of the texture is black: mean 0.5 of the luminance.
    scene.materials[2].emissive_texture = {add_texture(2, 1, {255, 255, 255, 255, 0, 0, 0, 255}, false), 0};
    scene.materials[2].emission_weight *= 0.5f;
    for (int i = 0; i < 12; ++i) {
      PunctualLight light{i % 3 == 0 ? PunctualType::kSpot : PunctualType::kPoint, {0, 1.5f, 0}, {0, -1, 0},
                          {0.3f, 0.3f, 0.3f}, 0.8f, 0.5f};
      light.position[0] = static_cast<float>(i) - 5.5f, light.position[2] = static_cast<float>(i % 5) - 2;
      scene.lights.push_back(light);
    }
  }
};

TEST(LightTree, PicturesHaveTheMeanOfSamplingByPowerAndUniformly) {
  struct Estimate {
    double mean = 0, variance = 0;
  };
  const auto estimate = [](LightChoice choice, uint64_t seed) {
    LitFloor s;
    ShadingOptions options;
    options.bounces = 3, options.seed = seed, options.light_choice = choice;
    s.prepare(options);
    constexpr uint32_t kPlaces = 60, kPaths = 1000;
    Estimate all;
    Numbers numbers(77);
    for (uint32_t place = 0; place < kPlaces; ++place) {
      const Vec3 to(numbers.uniform(-4, 4), 0, numbers.uniform(-4, 4)), from(3, 6, 2);
      double sum = 0, squares = 0;
      for (uint32_t i = 0; i < kPaths; ++i) {
        const Vec3 radiance = s.radiance(from, to - from, place, i);
        sum += radiance.x, squares += double{radiance.x} * radiance.x;
      }
      const double mean = sum / kPaths;
      all.mean += mean / kPlaces;
      all.variance += (squares / kPaths - mean * mean) / kPaths / (kPlaces * kPlaces);
    }
    return all;
  };
  const Estimate tree = estimate(LightChoice::kTree, 1), power = estimate(LightChoice::kPower, 2);
  const Estimate uniform = estimate(LightChoice::kUniform, 3);
  EXPECT_NEAR(uniform.mean, tree.mean, 4 * std::sqrt(tree.variance + uniform.variance));
  EXPECT_LT(std::sqrt(uniform.variance), 0.02 * tree.mean) << "too noisy to tell";
  EXPECT_GT(tree.mean, 0.05);
  EXPECT_NEAR(tree.mean, power.mean, 4 * std::sqrt(tree.variance + power.variance));
  EXPECT_LT(std::sqrt(tree.variance), 0.02 * tree.mean) << "too noisy to tell";
  EXPECT_LT(tree.variance, 0.5 * power.variance) << "what the tree is for";
}

TEST(LightTree, FewLightsAreChosenAsIfThereWereNone) {
  const auto radiance = [](LightChoice choice) {
    TriangleSoup soup;
    add_rectangle(soup, {-5, 0, -5}, {0, 0, 10}, {10, 0, 0}, 0);
    add_rectangle(soup, {-1, 3, -1}, {2, 0, 0}, {0, 0, 2}, 1);
    ShadingScene s(std::move(soup), {matte(Vec3(0.8f)), lamp(Vec3(3))});
    ShadingOptions options;
    options.light_choice = choice;
    s.prepare(options);
    return s.mean_radiance({3, 5, 0}, {-0.5f, -1, 0.1f}, 100);
  };
  EXPECT_EQ(radiance(LightChoice::kTree), radiance(LightChoice::kPower));
}

}  // namespace
}  // namespace shoal
