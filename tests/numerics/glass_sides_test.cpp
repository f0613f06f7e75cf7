// Rays keep to their side of glass: slabs as thin as the bound on offsets, and total reflection for thousands of bounces.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/numerics/leaving_rays.h"
#include "tests/support/shading_scene.h"

namespace shoal::testing {
namespace {

Material glass(float f0) {
  Material m = matte(Vec3(1));
  m.roughness = 0, m.specular = 1, m.dielectric_f0 = f0;
  m.effects = kEffectTransmission | kEffectVolume, m.layers = 0;
  return m;
}

MaterialLayers clear(float ior) {
  MaterialLayers l;
  l.transmission = 1, l.volume = 1, l.ior = ior;
  return l;
}

ShadingOptions under_a_sky(uint32_t bounces) {
  ShadingOptions options;
  options.bounces = bounces;
  options.roulette_start = bounces;
  options.environment.kind = EnvironmentOptions::Kind::kConstant;
  options.environment.radiance = Vec3(1);
  return options;
}

/// One path of a ShadingScene, a vertex at a time.
class Walk {
 public:
  Walk(ShadingScene& scene, const Vec3& origin, const Vec3& direction, uint32_t sample) : scene_(scene) {
    path.origin = origin, path.direction = direction, path.sample = sample;
  }
  /// Traces on; false when the ray leaves the scene.
  bool trace() {
    const Ray ray = scene_.trace(path.origin, path.direction, kRayInfinity, false);
    path.hit = ray.hit, path.t = ray.t;
    return ray.hit.valid();
  }
  Surface surface() const {
    return find_surface(path, scene_.scene.top_tree.instance(path.hit.instance),
                        scene_.geometry[path.hit.treelet].bytes(), {});
  }
  /// False when the path ends here.
  bool shade() {
    ShadeResult result;
    const Status status = scene_.shader->shade_hit(path, scene_.geometry[path.hit.treelet].bytes(),
                                                   scene_.attributes[path.hit.treelet].bytes(), result,
                                                   scene_.counters, scene_.cache_counters);
    EXPECT_TRUE(status.ok());
    path.origin = result.bounce_origin, path.direction = result.bounce_direction;
    return result.has_bounce;
  }
  bool inside() const { return (path.medium & kPathMediumMask) != 0; }

  PathState path;

 private:
  ShadingScene& scene_;
};

/// All of one glass.
class GlassScene : public ShadingScene {
 public:
  GlassScene(TriangleSoup soup, float ior, const Affine3& map = {})
      : ShadingScene(std::move(soup), {glass((ior - 1) * (ior - 1) / ((ior + 1) * (ior + 1)))}, map) {
    scene.material_layers = {clear(ior)};
  }
};

/// Two faces, `thickness` apart, that look away from each other; primitives 1000 and 1001 are the upper one.
TriangleSoup slab(float size, float thickness) {
  TriangleSoup soup;
  const Vec3 x(2 * size, 0, 0), y(0, 2 * size, 0);
  add_rectangle(soup, {-size, -size, size + thickness}, x, y, 0);
  add_rectangle(soup, {-size, -size, size}, y, x, 0);
  return soup;
}

struct SideTally {
  size_t vertices = 0, entered = 0, wrong_medium = 0, passed = 0, acne = 0;
};

/// Paths that meet the slab from either side at any angle.
SideTally cross_slab(ShadingScene& s, float size, float thickness, const Affine3& map, size_t count) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> octaves(0, 10);
  SideTally tally;
  s.prepare(under_a_sky(24));
  DVec3 normal = glm::cross(DVec3(map.column_x), DVec3(map.column_y));
  normal *= (glm::dot(normal, DVec3(map.column_z)) < 0 ? -1 : 1) / std::sqrt(glm::dot(normal, normal));
  const Vec3 up(normal);
  for (uint32_t i = 0; i < count; ++i) {
    Vec3 aim = random_vector(random, 0.3f * size);
    aim.z = size;
    const Vec3 way = leaving_direction(random, up, std::exp2(-octaves(random))) * (i % 2 == 0 ? 1.0f : -1.0f);
    Walk walk(s, map.point(aim) - way * (0.3f * size), way, i);
    uint32_t face = kNoIndex;
    while (walk.trace()) {
      const uint32_t now = walk.path.hit.primitive < 1002 ? 0 : 1;  // the soup counts from 1000
      ++tally.vertices;
      tally.acne += now == face;
      if (walk.inside() != (face != kNoIndex && now != face)) ++tally.wrong_medium;
      face = now;
      if (!walk.shade()) break;
      const bool leaves_up = glm::dot(walk.path.direction, up) > 0;
      tally.wrong_medium += walk.inside() != (leaves_up == (face == 1));
      tally.entered += walk.inside();
    }
    if (walk.path.hit.valid() || !walk.inside()) continue;
    // Out through a face, not through an open side?
    const Instance& instance = s.scene.top_tree.instance(0);
    const Vec3 from = instance.world_to_object.point(walk.path.origin);
    const Vec3 along = instance.world_to_object.vector(walk.path.direction);
    const Vec3 out = from + along * (((along.z > 0 ? size + thickness : size) - from.z) / along.z);
    tally.passed += std::max(std::abs(out.x), std::abs(out.y)) < 0.9f * size;
  }
  return tally;
}

TEST(GlassSides, WhatEntersASlabAsThinAsTheBoundLeavesItByAFace) {
  const Affine3 moved{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {7, -3, 5}};
  const Affine3 stretched{{0.6f, 0.8f, 0}, {-4, 3, 0}, {0, 0.1f, 0.5f}, {2, 1, -1}};
  const Affine3 mirrored{{-1, 0, 0}, {0, 1.5f, 0.2f}, {0, -0.1f, 1}, {0.1f, 0, 0}};
  size_t confused = 0;
  for (const float size : {1e-5f, 1.0f, 1e5f}) {
    for (Affine3 map : {Affine3{}, moved, stretched, mirrored}) {
      map.translation *= size;
      // The bound where paths meet the slab.
      const GlassScene plain(slab(size, 0.1f * size), 1.5f, map);
      const Ray ray = plain.trace(map.point({0.3f * size, 0.2f * size, 2 * size}), map.vector({0, 0, -size}),
                                  kRayInfinity, false);
      PathState path;
      path.origin = ray.origin, path.direction = ray.direction, path.hit = ray.hit, path.t = ray.t;
      ASSERT_TRUE(ray.hit.valid());
      const Surface surface = find_surface(path, plain.scene.top_tree.instance(0), plain.geometry[0].bytes(), {});
      const float reach = offset_reach(surface.position, surface.geometric_normal);
      const float height = glm::dot(surface.geometric_normal, map.vector({0, 0, 1}));
      for (const float times : {0.02f, 2.0f, 4.0f, 64.0f, 1e3f}) {
        const float thickness = times * reach / std::abs(height);
        GlassScene s(slab(size, thickness), 1.5f, map);
        const SideTally tally = cross_slab(s, size, thickness, map, rays_to_try(150));
        EXPECT_GE(tally.vertices, rays_to_try(150));
        if (times < 1) {
          confused += tally.passed + tally.wrong_medium + tally.acne;
          continue;
        }
        EXPECT_GT(tally.entered, 50u);
        EXPECT_EQ(tally.wrong_medium, 0u) << size << ", " << times << " times the bound";
        EXPECT_EQ(tally.passed, 0u) << size << ", " << times << " times the bound";
        EXPECT_EQ(tally.acne, 0u) << size << ", " << times << " times the bound";
        EXPECT_EQ(s.counters.invalid.total(), 0u);
      }
    }
  }
  RecordProperty("sides_lost_below_the_bound", std::to_string(confused));
}

TriangleSoup box(float size) {
  TriangleSoup soup;
  const Vec3 x(2 * size, 0, 0), y(0, 2 * size, 0), z(0, 0, 2 * size), c(-size, -size, -size);
  add_rectangle(soup, c, y, x, 0), add_rectangle(soup, c + z, x, y, 0);
  add_rectangle(soup, c, z, y, 0), add_rectangle(soup, c + x, y, z, 0);
  add_rectangle(soup, c, x, z, 0), add_rectangle(soup, c + y, z, x, 0);
  return soup;
}

TEST(GlassSides, TotalReflectionGoesOnForTenThousandBounces) {
  constexpr uint32_t kBounces = 10000;
  size_t left_near_an_edge = 0, refracted = 0, reflected = 0;
  float most = 0, least = 1;
  for (const float size : {1e-6f, 1.0f, 1e6f}) {
    GlassScene s(box(size), 2.4f);
    s.prepare(under_a_sky(kBounces));
    std::mt19937 random(5);
    for (uint32_t i = 0; i < rays_to_try(8); ++i) {
      // Every face is met far beyond the angle of total reflection, 25 degrees.
      Walk walk(s, random_vector(random, 0.5f * size), Vec3(1, 0.9f, -1.1f) + random_vector(random, 0.1f), i);
      walk.path.medium = 1;
      uint32_t vertices = 0;
      while (walk.trace()) {
        const Surface at = walk.surface();
        ++vertices;
        if (!walk.shade()) break;
        ASSERT_TRUE(std::isfinite(walk.path.throughput.x)) << vertices;
        if (!walk.inside()) {
          ++refracted;
          break;
        }
        ++reflected;
        const float reach = offset_reach(at.position, at.geometric_normal);
        int close = 0;  // faces
        for (int axis = 0; axis < 3; ++axis) close += size - std::abs(at.position.point[axis]) < 2 * reach;
        left_near_an_edge += close > 1;
        if (close > 1) break;  // it may start behind the other face
      }
      if (walk.inside()) { EXPECT_TRUE(walk.path.hit.valid()) << "left the box after " << vertices << " of " << size; }
      most = std::max(most, walk.path.throughput.x), least = std::min(least, walk.path.throughput.x);
    }
    EXPECT_EQ(s.counters.invalid.total(), 0u);
  }
  EXPECT_GT(reflected, 24u * kBounces / 2);
  // Nothing is lost or won but roundings and the interpolation of the table of what glass sends out.
  EXPECT_LT(most, 1.5f);
  EXPECT_GT(least, 0.5f);
  RecordProperty("reflected", std::to_string(reflected));
  RecordProperty("refracted_paths", std::to_string(refracted));
  RecordProperty("left_near_an_edge", std::to_string(left_near_an_edge));
  RecordProperty("throughput_at_most", std::to_string(most));
  RecordProperty("throughput_at_least", std::to_string(least));
}

}  // namespace
}  // namespace shoal::testing
