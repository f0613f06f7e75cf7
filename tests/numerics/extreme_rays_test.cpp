// Rays of every sort at triangles of every sort: components that are zero, -0, denormal or huge, along axes in the faces of
// boxes and the planes of triangles, from a surface or a corner, of one ulp of length. What testing every triangle finds,
// every kernel finds, to the bit, by each kind of test.
#include <gtest/gtest.h>

#include "tests/numerics/every_kernel.h"
#include "tests/numerics/watertight_meshes.h"
#include "tests/support/built_scene.h"

namespace shoal::testing {
namespace {

constexpr float kDenormal = 0x1p-149f, kSmallest = 0x1p-126f, kLargest = 0x1.fffffep127f;
constexpr TriangleTest kKinds[] = {TriangleTest::kFast, TriangleTest::kWatertight, TriangleTest::kDouble};

/// Traces every way by each kind, and compares with every triangle of every instance. Returns the hits.
size_t expect_brute_force(const TestScene& scene, const std::vector<Ray>& rays) {
  size_t hits = 0;
  for (const TriangleTest test : kKinds) {
    const std::vector<Ray> found = trace_every_way(scene, rays, test);
    for (size_t i = 0; i < rays.size(); ++i) {
      Ray expected = rays[i];
      brute_force(scene, expected, test);
      const std::string what = std::string(triangle_test_name(test)) + ", ray " + std::to_string(i);
      EXPECT_EQ(expected.hit.valid(), found[i].hit.valid()) << what;
      hits += found[i].hit.valid() ? 1 : 0;
      if (expected.any_hit() || !expected.hit.valid()) continue;
      EXPECT_EQ(expected.t, found[i].t) << what;
      EXPECT_EQ(expected.hit.instance, found[i].hit.instance) << what;
      EXPECT_EQ(expected.hit.primitive, found[i].hit.primitive) << what;
      EXPECT_TRUE(std::isfinite(found[i].t) && found[i].t > 0) << what;
    }
    if (::testing::Test::HasFailure()) break;
  }
  return hits;
}

/// A grid of unit squares, flat in z = 0: boxes without thickness that share their faces.
std::vector<TestTriangle> flat_grid(int side) {
  std::vector<TestTriangle> grid;
  for (int x = 0; x < side; ++x) {
    for (int y = 0; y < side; ++y) {
      const Vec3 a(x, y, 0), b(x + 1, y, 0), c(x + 1, y + 1, 0), d(x, y + 1, 0);
      grid.push_back({{a, b, c}, 0});
      grid.push_back({{a, c, d}, 0});
    }
  }
  number_triangles(grid);
  return grid;
}

struct Case {
  const char* name;
  std::vector<TestTriangle> triangles;
};

std::vector<Case> cases(std::mt19937& random) {
  return {{"soup", random_soup(random, 400, 0.3f)},
          {"flat grid", flat_grid(8)},
          {"box along the axes", cut_box("", 4, Vec3(-1), Vec3(0.5f)).triangles},
          {"triangles of one ulp", cut_box("", 4, Vec3(1), Vec3(0x1p-23f)).triangles}};
}

/// The same rays, every third for any hit.
void some_for_any_hit(std::vector<Ray>& rays) {
  for (size_t i = 0; i < rays.size(); i += 3) rays[i].path = Ray::kAnyHitBit;
}

TEST(ExtremeRays, WithComponentsOfEverySize) {
  std::mt19937 random(1);
  const float sizes[] = {0.0f,  -0.0f, kDenormal, -kDenormal, kSmallest, -0x1p-130f, 1e-30f, -1e-10f,
                         1e-5f, 1.0f,  -1.0f,     3e7f,       -1e20f,    1e30f,      kLargest, -kLargest};
  for (const Case& of : cases(random)) {
    SCOPED_TRACE(of.name);
    const TestScene scene = build_scene({of.triangles}, {{0, {}}}, 4u << 10);
    std::vector<Ray> rays;
    for (size_t i = 0; i < rays_to_try(3000); ++i) {
      const TestTriangle& aim = of.triangles[random() % of.triangles.size()];
      const Vec3 target = (aim.p[0] + aim.p[1] + aim.p[2]) / 3.0f;
      Vec3 origin = target + random_vector(random), direction = target - origin;
      const auto pick = [&] { return sizes[random() % std::size(sizes)]; };
      if (i % 4 != 0) direction[static_cast<int>(random() % 3)] = pick();
      if (i % 4 == 2) direction[static_cast<int>(random() % 3)] = pick();
      if (i % 4 == 3) origin[static_cast<int>(random() % 3)] = pick();
      if (i % 7 == 0) direction = Vec3(pick(), pick(), pick());
      if (i % 11 == 0) direction *= 0x1p-140f;
      if (i % 13 == 0) direction *= 0x1p+90f;
      if (direction == Vec3(0)) direction.x = kDenormal;
      rays.push_back(make_ray(origin, direction));
    }
    some_for_any_hit(rays);
    EXPECT_GT(expect_brute_force(scene, rays), rays.size() / 4);
  }
}

TEST(ExtremeRays, AlongAxesInTheFacesOfBoxesAndThePlanesOfTriangles) {
  std::mt19937 random(2);
  for (const Case& of : cases(random)) {
    SCOPED_TRACE(of.name);
    const TestScene scene = build_scene({of.triangles}, {{0, {}}}, 4u << 10);
    std::vector<Ray> rays;
    for (size_t i = 0; i < rays_to_try(2000); ++i) {
      const TestTriangle& aim = of.triangles[random() % of.triangles.size()];
      const int axis = static_cast<int>(random() % 3);
      const float way = random() % 2 != 0 ? 1.0f : -1.0f;
      Vec3 origin = aim.p[random() % 3], direction(random() % 2 != 0 ? 0.0f : -0.0f);
      origin[axis] -= way * (1 + static_cast<float>(random() % 16));
      direction[axis] = way;
      if (i % 3 == 1) {  // in its plane, through it or its edge
        origin = aim.p[0] + (aim.p[0] - aim.p[1]) * 3.0f;
        direction = (i % 2 != 0 ? aim.p[1] : (aim.p[1] + aim.p[2]) * 0.5f) - origin;
      } else if (i % 3 == 2) {  // an ulp beside
        origin[(axis + 1) % 3] = std::nextafter(origin[(axis + 1) % 3], way * 9);
      }
      if (direction == Vec3(0)) direction = Vec3(0, 0, 1);
      rays.push_back(make_ray(origin, direction));
    }
    some_for_any_hit(rays);
    EXPECT_GT(expect_brute_force(scene, rays), rays.size() / 10);
  }
}

TEST(ExtremeRays, ThatBeginOnASurfaceOrInACorner) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (const Case& of : cases(random)) {
    SCOPED_TRACE(of.name);
    const TestScene scene = build_scene({of.triangles}, {{0, {}}}, 4u << 10);
    std::vector<Ray> rays;
    for (size_t i = 0; i < rays_to_try(2000); ++i) {
      const TestTriangle& from = of.triangles[random() % of.triangles.size()];
      const TestTriangle& to = of.triangles[random() % of.triangles.size()];
      Vec3 origin = from.p[random() % 3];
      if (i % 2 != 0) origin = from.p[0] + (from.p[1] - from.p[0]) * uniform(random) * 0.5f;
      Vec3 direction = i % 3 == 0 ? to.p[random() % 3] - origin : random_vector(random);
      if (direction == Vec3(0)) direction = Vec3(1, 0, 0);
      rays.push_back(make_ray(origin, direction));
    }
    some_for_any_hit(rays);
    EXPECT_GT(expect_brute_force(scene, rays), rays.size() / 20);
  }
}

TEST(ExtremeRays, ThatEndAnUlpBeforeAtOrBehindAHit) {
  std::mt19937 random(4);
  for (const Case& of : cases(random)) {
    SCOPED_TRACE(of.name);
    const TestScene scene = build_scene({of.triangles}, {{0, {}}}, 4u << 10);
    for (const TriangleTest test : kKinds) {
      std::vector<Ray> rays;
      for (size_t i = 0; i < rays_to_try(500); ++i) {
        const TestTriangle& aim = of.triangles[random() % of.triangles.size()];
        const Vec3 origin = aim.p[0] + random_vector(random);
        rays.push_back(make_ray(origin, (aim.p[0] + aim.p[1] + aim.p[2]) / 3.0f - origin));
      }
      std::vector<Ray> shortened, expected;
      for (const Ray& end : trace_every_way(scene, rays, test)) {
        if (!end.hit.valid()) continue;
        for (const float t : {std::nextafter(end.t, 0.0f), end.t, std::nextafter(end.t, kLargest)}) {
          Ray ray = make_ray(end.origin, end.direction, t);
          shortened.push_back(ray);
          expected.push_back(end);
          ray.path = Ray::kAnyHitBit;
          shortened.push_back(ray);
          expected.push_back(end);
        }
      }
      ASSERT_GT(shortened.size(), rays.size());
      const std::vector<Ray> found = trace_every_way(scene, shortened, test);
      for (size_t i = 0; i < found.size(); ++i) {
        // Closest hit: ends included. Any hit: the end is not.
        const bool reaches = shortened[i].any_hit() ? shortened[i].t > expected[i].t : shortened[i].t >= expected[i].t;
        ASSERT_EQ(found[i].hit.valid(), reaches) << triangle_test_name(test) << ", ray " << i;
      }
    }
  }
}

TEST(ExtremeRays, AmongInstancesOfEverySize) {
  std::mt19937 random(5);
  const auto mesh = cut_box("", 3, Vec3(-1), Vec3(2.0f / 3)).triangles;
  std::vector<Placement> placements{{0, {}}};
  for (int i = 0; i < 20; ++i) {
    Placement p;
    const float by = std::ldexp(1.0f, static_cast<int>(random() % 60) - 30);
    p.object_to_world = {random_vector(random, by), random_vector(random, by), random_vector(random, by * (i % 3 ? 1 : 0.01f)),
                         random_vector(random, i % 2 != 0 ? 10.0f : 1e6f)};
    placements.push_back(p);
  }
  const TestScene scene = make_scene({mesh}, placements, {20, 4});
  std::vector<Ray> rays;
  for (size_t i = 0; i < rays_to_try(2000); ++i) {
    const Affine3& map = placements[random() % placements.size()].object_to_world;
    const TestTriangle& aim = mesh[random() % mesh.size()];
    const Vec3 target = map.point(aim.p[random() % 3]);
    const Vec3 origin = map.point(random_vector(random, i % 2 != 0 ? 0.5f : 30.0f));
    Vec3 direction = target - origin;
    if (i % 5 == 0) direction[static_cast<int>(random() % 3)] = 0.0f;
    if (direction == Vec3(0)) direction = Vec3(1, 0, 0);
    rays.push_back(make_ray(origin, direction));
  }
  some_for_any_hit(rays);
  EXPECT_GT(expect_brute_force(scene, rays), rays.size() / 2);
}

}  // namespace
}  // namespace shoal::testing
