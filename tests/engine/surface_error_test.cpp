// New rays must not meet the triangle they leave, and shadow rays not the emitter they end on, through any
// transform.
#include "engine/surface_error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "engine/frame.h"
#include "tests/support/hand_made_scene.h"
#include "treelets/triangle_test.h"

namespace shoal {
namespace {

using testing::make_instance;

class Random {
 public:
  float between(float lo, float hi) { return std::uniform_real_distribution<float>(lo, hi)(engine_); }
  float power(float lo, float hi) { return std::exp2(between(lo, hi)); }
  Vec3 direction() {
    for (;;) {
      const Vec3 v(between(-1, 1), between(-1, 1), between(-1, 1));
      if (glm::dot(v, v) > 0.01f && glm::dot(v, v) <= 1) return glm::normalize(v);
    }
  }

 private:
  std::mt19937 engine_{7};
};

struct Corners {
  Vec3 p[3];
};

enum class Shape { kPlain, kAxisAligned, kSliver, kNearOrigin };

Corners make_triangle(Random& random, Shape shape) {
  const float size = random.power(-10, 10), away = shape == Shape::kNearOrigin ? 0 : random.power(-10, 12);
  const Vec3 center = random.direction() * away;
  Vec3 edge1 = random.direction() * size, edge2 = random.direction() * size;
  if (shape == Shape::kSliver) edge2 = edge1 * random.between(-1, 1) + edge2 * random.power(-14, -4);
  if (shape == Shape::kAxisAligned) edge1.y = edge2.y = 0;
  return {{center, center + edge1, center + edge2}};
}

Instance make_transform(Random& random, bool identity, const Corners& c) {
  Affine3 m;
  if (!identity) {
    const Frame frame(random.direction());
    m = {frame.x * random.power(-3, 3), frame.y * random.power(-3, 3), frame.z * random.power(-3, 3),
         random.direction() * random.power(-5, 8)};
    m.column_x += m.column_y * random.between(-1, 1);
  }
  Bounds3 bounds;
  for (const Vec3& p : c.p) bounds.include(p);
  return make_instance({0, m}, 0, bounds);
}

Vec3 world_normal(const Corners& c, const Instance& instance) {
  const glm::dvec3 e1 = instance.object_to_world.vector(c.p[1] - c.p[0]);
  const glm::dvec3 e2 = instance.object_to_world.vector(c.p[2] - c.p[0]);
  const glm::dvec3 n = glm::cross(e1, e2);
  return Vec3(n / glm::length(n));
}

bool hits(const Vec3& origin, const Vec3& direction, float t_max, const Corners& c, const Instance& instance,
          TriangleHit* hit) {
  Ray ray;
  ray.origin = origin, ray.direction = direction, ray.t = t_max;
  return intersect_triangle(to_object_space(ray, instance), c.p[0], c.p[1], c.p[2], t_max, *hit) && hit->t < t_max;
}

struct Rates {
  int tried = 0, leaving = 0, arriving = 0;
};

Rates measure(Shape shape, bool identity) {
  Random random;
  Rates rates;
  for (int i = 0; i < 60000; ++i) {
    const Corners c = make_triangle(random, shape);
    const Instance instance = make_transform(random, identity, c);
    Vec3 normal = world_normal(c, instance);
    if (!std::isfinite(normal.x)) continue;
    const float b1 = random.between(0, 1), b2 = random.between(0, 1 - b1);
    const BoundedPoint aim = to_world(point_on_triangle(c.p[0], c.p[1], c.p[2], b1, b2), instance);
    const float reach = glm::length(instance.object_to_world.vector(c.p[1] - c.p[0]));
    const Vec3 eye = aim.point + random.direction() * reach * random.power(-3, 6);
    TriangleHit hit{0, 0, 0};
    if (!hits(eye, aim.point - eye, kRayInfinity, c, instance, &hit)) continue;
    // Seen edge on, to within rounding, neither side is the right one (and no light passes).
    if (std::abs(glm::dot(normal, eye - aim.point)) < 1e-5f * glm::length(eye - aim.point)) continue;
    ++rates.tried;
    if (glm::dot(normal, eye - aim.point) < 0) normal = -normal;
    const BoundedPoint point = to_world(point_on_triangle(c.p[0], c.p[1], c.p[2], hit.b1, hit.b2), instance);
    Vec3 out = Frame(normal).to_world(sample_cosine_hemisphere(random.between(0, 1), random.between(0, 1)));
    if (hits(offset_point(point, normal), out, kRayInfinity, c, instance, &hit)) ++rates.leaving;

    const BoundedPoint target = ray_end(aim, eye, &instance);
    if (glm::dot(normal, eye - aim.point) < glm::dot(glm::abs(normal), target.error))
      continue;  // closer than errors
    if (hits(eye, offset_point(target, normal) - eye, 1, c, instance, &hit)) ++rates.arriving;
  }
  return rates;
}

TEST(SurfaceError, RaysNeitherMeetTheTriangleTheyLeaveNorTheOneTheyEndOn) {
  for (const bool identity : {true, false}) {
    for (const Shape shape : {Shape::kPlain, Shape::kAxisAligned, Shape::kSliver, Shape::kNearOrigin}) {
      const Rates rates = measure(shape, identity);
      EXPECT_GT(rates.tried, 10000);
      EXPECT_EQ(rates.leaving, 0) << "shape " << static_cast<int>(shape) << ", identity " << identity << " of "
                                  << rates.tried;
      EXPECT_EQ(rates.arriving, 0) << "shape " << static_cast<int>(shape) << ", identity " << identity << " of "
                                   << rates.tried;
    }
  }
}

}  // namespace
}  // namespace shoal
