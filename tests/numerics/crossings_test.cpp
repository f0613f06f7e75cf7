// Nothing is counted twice: a line goes into a closed mesh as often as out of it, and crosses a fan once. A point on an
// edge belongs to all triangles there for the engine, which takes one of them; here it is given to one by a rule (what a
// step along +x, then an infinitely smaller one along +y decides), and every triangle that the engine accepts beyond
// those must have the ray exactly on its border.
#include <gtest/gtest.h>

#include "tests/numerics/every_kernel.h"
#include "tests/numerics/watertight_meshes.h"
#include "tests/support/built_scene.h"

namespace shoal::testing {
namespace {

RaySpace space_of(const Ray& ray, const TestScene& scene) { return to_object_space(ray, scene.instances[0]); }

/// The sign of the edge from a to b, seen from the origin moved by the rule; zero if both ends lie in one place.
int side(const triangle_test::Sheared& a, const triangle_test::Sheared& b) {
  const double edge = triangle_test::exact_edge(a, b);
  if (edge != 0) return edge > 0 ? 1 : -1;
  // (a - m) x (b - m) = a x b - m x (b - a): by m = (1, 0) less than nothing, then (0, 1).
  if (a.y != b.y) return a.y > b.y ? 1 : -1;
  return a.x == b.x ? 0 : b.x > a.x ? 1 : -1;
}

struct Crossing {
  int way = 0;         ///< +1: from the front, -1: from behind, 0: none
  bool on_border = false;
};

Crossing cross(const RaySpace& space, const TestTriangle& t) {
  const auto a = triangle_test::shear(space, t.p[0]), b = triangle_test::shear(space, t.p[1]),
             c = triangle_test::shear(space, t.p[2]);
  const int u = side(c, b), v = side(a, c), w = side(b, a);
  const bool zero = triangle_test::exact_edge(c, b) == 0 || triangle_test::exact_edge(a, c) == 0 ||
                    triangle_test::exact_edge(b, a) == 0;
  return {u == v && v == w ? u : 0, zero};
}

struct Crossings {
  int sum = 0;           ///< in less out
  size_t counted = 0;    ///< by the rule, before the ray's end
  size_t on_border = 0;  ///< accepted beside those
};

Crossings cross_all(const TestScene& scene, const Ray& ray) {
  const RaySpace space = space_of(ray, scene);
  Crossings crossings;
  for (const TestTriangle& t : scene.objects[0]) {
    TriangleHit hit;
    const bool accepted = intersect_triangle(space, t.p[0], t.p[1], t.p[2], ray.t, hit);
    const Crossing crossing = cross(space, t);
    if (!accepted) continue;
    crossings.sum += crossing.way;
    crossings.counted += crossing.way != 0 ? 1 : 0;
    if (crossing.way != 0) continue;
    EXPECT_TRUE(crossing.on_border) << "triangle " << t.primitive << " is accepted, and the ray is not in it";
    ++crossings.on_border;
  }
  return crossings;
}

TEST(Crossings, LinesGoIntoClosedMeshesAsOftenAsOut) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> uniform(0, 1);
  size_t rays = 0, crossed = 0, on_border = 0;
  for (const ClosedMesh& mesh : closed_meshes()) {
    if (mesh.triangles.size() > 3000) continue;
    SCOPED_TRACE(mesh.name);
    const TestScene scene = build_scene({mesh.triangles}, {{0, {}}}, 16u << 10);
    const float size = max_abs_of(bounds_of(mesh.triangles));
    std::vector<Ray> outside, inside = rays_from_inside(mesh, random, 300);
    for (int i = 0; i < 300; ++i) {
      const TestTriangle& t = mesh.triangles[random() % mesh.triangles.size()];
      Vec3 origin = mesh.inside + glm::normalize(random_vector(random)) * (4 * size);
      Vec3 target = i % 3 == 0 ? t.p[0] : t.p[0] + (t.p[1] - t.p[0]) * uniform(random);
      if (i % 4 == 0) {  // along an axis, through corners
        const int axis = static_cast<int>(random() % 3);
        origin = target = t.p[0];
        origin[axis] += 4 * size;
      }
      outside.push_back(make_ray(origin, target - origin));
    }
    for (const Ray& ray : outside) {
      const Crossings crossings = cross_all(scene, ray);
      ASSERT_EQ(crossings.sum, 0);
      ASSERT_EQ(crossings.counted % 2, 0u);
      crossed += crossings.counted, on_border += crossings.on_border;
    }
    for (const Ray& ray : inside) {
      const Crossings crossings = cross_all(scene, ray);
      ASSERT_EQ(std::abs(crossings.sum), 1);
      ASSERT_EQ(crossings.counted % 2, 1u);
      on_border += crossings.on_border;
    }
    rays += outside.size() + inside.size();
  }
  EXPECT_GT(crossed, rays / 4);
  EXPECT_GT(on_border, rays / 20) << "rays should hit edges exactly";
  std::printf("[numerics] crossings: %zu rays, %zu crossings from outside, %zu triangles accepted for their border only\n",
              rays, crossed, on_border);
}

/// `count` triangles around the origin, a flat cone, closed to a full turn.
std::vector<TestTriangle> open_fan(uint32_t count) {
  std::vector<TestTriangle> triangles(count);
  const auto rim = [&](uint32_t i) {
    const double angle = 2 * 3.14159265358979 * (i % count) / count;
    return Vec3(std::cos(angle), std::sin(angle), 0.25);
  };
  for (uint32_t i = 0; i < count; ++i) triangles[i] = {{Vec3(0), rim(i), rim(i + 1)}, i};
  return triangles;
}

TEST(Crossings, AFanIsHitOnceAtItsSpokesAndAtItsHub) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (const uint32_t count : {3u, 5u, 64u, 1000u, 10000u}) {
    const auto triangles = open_fan(count);
    const TestScene scene = make_scene({triangles}, {{0, {}}}, {500, 4});
    std::vector<Ray> rays;
    for (int i = 0; i < (count < 1000 ? 2000 : 200); ++i) {
      const TestTriangle& aim = triangles[random() % count];
      const Vec3 origin = Vec3(0, 0, i % 2 ? 2 : -2) + random_vector(random, 0.3f);
      const Vec3 target = i % 8 == 0 ? Vec3(0) : aim.p[1] * (0.8f * uniform(random));
      rays.push_back(make_ray(origin, target - origin));
    }
    const std::vector<Ray> found = trace_every_way(scene, rays);
    for (size_t i = 0; i < rays.size(); ++i) {
      ASSERT_TRUE(found[i].hit.valid()) << count << " triangles, ray " << i;
      const Crossings crossings = cross_all(scene, rays[i]);
      ASSERT_EQ(crossings.counted, 1u) << count << " triangles, ray " << i;
    }
  }
}

}  // namespace
}  // namespace shoal::testing
