// Rays at the shared edges and at the common vertex of fans: one hit each, whatever the fan.
#include <gtest/gtest.h>

#include "tests/numerics/every_kernel.h"

namespace shoal::testing {
namespace {

/// `count` triangles around the origin, in a plane about z = 0 or a cone, closed to a full turn.
std::vector<TestTriangle> fan(uint32_t count, float height) {
  std::vector<Vec3> rim(count);
  for (uint32_t i = 0; i < count; ++i) {
    const double angle = 2 * 3.14159265358979 * i / count;
    rim[i] = Vec3(std::cos(angle), std::sin(angle), height);
  }
  std::vector<TestTriangle> triangles(count);
  for (uint32_t i = 0; i < count; ++i) triangles[i] = {{Vec3(0), rim[i], rim[(i + 1) % count]}, i};
  return triangles;
}

TEST(WatertightFan, RaysAtSpokesAndAtTheHubHitIt) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (const uint32_t count : {3u, 5u, 64u, 1000u, 10000u}) {
    const auto triangles = fan(count, 0.25f);
    const TestScene scene = make_scene({triangles}, {{0, {}}}, {500, 4});
    std::vector<Ray> rays;
    for (int i = 0; i < (count < 10000 ? 2000 : 200); ++i) {
      const TestTriangle& aim = triangles[random() % count];
      const Vec3 origin = Vec3(0, 0, i % 2 ? 2 : -2) + random_vector(random, 0.5f);
      const Vec3 target = i % 8 == 0 ? Vec3(0) : aim.p[1] * (0.9f * uniform(random));
      rays.push_back(make_ray(origin, target - origin));
    }
    const std::vector<Ray> found = trace_every_way(scene, rays);
    size_t missed = 0;
    for (const Ray& ray : found) missed += !ray.hit.valid();
    EXPECT_EQ(missed, 0u) << count << " triangles";
  }
}

}  // namespace
}  // namespace shoal::testing
