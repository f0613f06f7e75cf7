// The triangle test against an independent one in double, and its watertightness.
#include "treelets/triangle_test.h"

#include <gtest/gtest.h>

#include "tests/support/hand_made_scene.h"

namespace shoal::testing {
namespace {

/// Moeller & Trumbore 1997 in double. `margin`: the smallest barycentric coordinate, signed.
struct DoubleHit {
  double t, b1, b2, margin, sine;
};
using Double3 = glm::dvec3;

DoubleHit intersect_double(const Vec3& origin, const Vec3& direction, const TestTriangle& triangle) {
  const Double3 o(origin), d(direction), a(triangle.p[0]), e1 = Double3(triangle.p[1]) - a,
                                                           e2 = Double3(triangle.p[2]) - a;
  const Double3 p = glm::cross(d, e2), s = o - a, q = glm::cross(s, e1);
  const double det = glm::dot(e1, p);
  const double b1 = glm::dot(s, p) / det, b2 = glm::dot(d, q) / det;
  const double sine = std::abs(det) / (glm::length(d) * glm::length(glm::cross(e1, e2)));
  return {glm::dot(e2, q) / det, b1, b2, std::min({1 - b1 - b2, b1, b2}), sine};
}

RaySpace space_of(const Vec3& origin, const Vec3& direction, float max_abs_coordinate) {
  RaySpace space = prepare_ray(origin, direction);
  set_pad(space, object_pad(space, max_abs_coordinate), 1);
  return space;
}

TEST(TriangleTest, AgreesWithMoellerTrumboreInDouble) {
  std::mt19937 random(1);
  size_t hits = 0;
  for (int i = 0; i < 200000; ++i) {
    const TestTriangle triangle{{random_vector(random), random_vector(random), random_vector(random)}, 0};
    const Vec3 origin = random_vector(random, 2), direction = random_vector(random, 2);
    const DoubleHit expected = intersect_double(origin, direction, triangle);
    if (std::abs(expected.margin) < 1e-4 || expected.sine < 1e-2 || std::abs(expected.t) < 1e-4) continue;
    TriangleHit found;
    const bool hit = intersect_triangle(space_of(origin, direction, 1), triangle.p[0], triangle.p[1], triangle.p[2],
                                        kRayInfinity, found);
    ASSERT_EQ(hit, expected.margin > 0 && expected.t > 0) << "triangle " << i << ", margin " << expected.margin;
    if (!hit) continue;
    ++hits;
    // Positions err by about 6 u R; the area and the angle amplify it, both kept away from zero above.
    EXPECT_NEAR(found.t, expected.t, 1e-4 * (1 + expected.t)) << "triangle " << i;
    EXPECT_NEAR(found.b1, expected.b1, 2e-3) << "triangle " << i;
    EXPECT_NEAR(found.b2, expected.b2, 2e-3) << "triangle " << i;
  }
  EXPECT_GT(hits, 2000u);
}

TEST(TriangleTest, HitsBothSidesAndAnyOrderOfCornersAlike) {
  std::mt19937 random(2);
  for (int i = 0; i < 20000; ++i) {
    const Vec3 p[3] = {random_vector(random), random_vector(random), random_vector(random)};
    const RaySpace space = space_of(random_vector(random, 2), random_vector(random), 1);
    TriangleHit hit;
    const bool first = intersect_triangle(space, p[0], p[1], p[2], kRayInfinity, hit);
    EXPECT_EQ(first, intersect_triangle(space, p[0], p[2], p[1], kRayInfinity, hit));
    EXPECT_EQ(first, intersect_triangle(space, p[1], p[2], p[0], kRayInfinity, hit));
  }
}

TEST(TriangleTest, LosesNoRayBetweenTrianglesThatShareAnEdge) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (int i = 0; i < 100000; ++i) {
    // Two triangles on either side of the edge a-b, aimed at the edge from above, at all scales and distances.
    const float scale = std::ldexp(1.0f, static_cast<int>(random() % 40) - 20);
    const float away = std::ldexp(1.0f, static_cast<int>(random() % 16));
    const Vec3 shift = random_vector(random, away);
    const Vec3 a = (Vec3(0, -1, 0) + random_vector(random, 0.1f) + shift) * scale;
    const Vec3 b = (Vec3(0, 1, 0) + random_vector(random, 0.1f) + shift) * scale;
    const Vec3 left = (Vec3(-1, 0, 0) + shift) * scale, right = (Vec3(1, 0, 0) + shift) * scale;
    const Vec3 origin = (Vec3(0, 0, 2) + random_vector(random) + shift) * scale;
    const Vec3 aim = a + (b - a) * (0.1f + 0.8f * uniform(random));
    if (away > 4096 && std::abs(left.x - right.x) < scale) continue;  // the shift ate the triangles
    float extent = 0;
    for (const Vec3& p : {a, b, left, right}) extent = std::max(extent, max_abs(&p.x));
    const RaySpace space = space_of(origin, aim - origin, extent);
    TriangleHit hit;
    EXPECT_TRUE(intersect_triangle(space, a, b, left, kRayInfinity, hit) ||
                intersect_triangle(space, b, a, right, kRayInfinity, hit))
        << "pair " << i;
  }
}

TEST(TriangleTest, TheDoubleFallbackDecidesProductsThatUnderflowOrOverflow) {
  for (const float scale : {1e-30f, 1e-25f, 1e15f, 1e18f, 1e25f}) {
    const Vec3 a = Vec3(-1, -1, 1) * scale, b = Vec3(2, -1, 1) * scale, c = Vec3(-1, 2, 1) * scale;
    const RaySpace space = space_of({0, 0, 0}, {0.1f, 0.05f, 1}, 2 * scale);
    TriangleHit hit;
    ASSERT_TRUE(intersect_triangle(space, a, b, c, kRayInfinity, hit)) << scale;
    EXPECT_NEAR(hit.t / scale, 1, 1e-6) << scale;
    EXPECT_NEAR(hit.b1, 1.1 / 3, 1e-6) << scale;
    const RaySpace miss = space_of({0, 0, 0}, {0.51f, 0.51f, 1}, 2 * scale);
    EXPECT_FALSE(intersect_triangle(miss, a, b, c, kRayInfinity, hit)) << scale;
  }
}

TEST(TriangleTest, NeverAcceptsBehindTheOriginNorBeyondTheEnd) {
  std::mt19937 random(4);
  for (int i = 0; i < 50000; ++i) {
    const Vec3 p[3] = {random_vector(random), random_vector(random), random_vector(random)};
    const RaySpace space = space_of(random_vector(random), random_vector(random), 1);
    const float end = std::abs(random_vector(random).x);
    TriangleHit hit;
    if (!intersect_triangle(space, p[0], p[1], p[2], end, hit)) continue;
    EXPECT_GT(hit.t, 0);
    EXPECT_LE(hit.t, end);
    EXPECT_GE(hit.b1, 0);
    EXPECT_GE(hit.b2, 0);
    EXPECT_LE(hit.b1 + hit.b2, 1 + 4 * kRoundingUnit);
  }
}

TEST(TriangleTest, AnglesOfTheWorstSortGiveNoNumbersThatAreNotFinite) {
  const float values[] = {0.0f, -0.0f, 1.0f, -1e-45f, 1e-39f, 1e38f, -3e38f, 1e-20f};
  std::mt19937 random(5);
  const auto pick = [&] { return Vec3(values[random() % 8], values[random() % 8], values[random() % 8]); };
  for (int i = 0; i < 200000; ++i) {
    const RaySpace space = space_of(pick(), pick(), 3e38f);
    TriangleHit hit;
    if (!intersect_triangle(space, pick(), pick(), pick(), kRayInfinity, hit)) continue;
    EXPECT_TRUE(std::isfinite(hit.t) && hit.t > 0);
    EXPECT_TRUE(std::isfinite(hit.b1) && std::isfinite(hit.b2));
  }
}

TEST(FindTriangle, IntersectKnownRepeatsTheHitToTheBit) {
  std::mt19937 random(6);
  const auto soup = random_soup(random, 500, 0.3f);
  Placement placement;
  placement.object_to_world.column_x = {0.5f, 0.5f, 0}, placement.object_to_world.translation = {3, -2, 1};
  const TestScene scene = make_scene({soup}, {{0, {}}, placement});
  const TopTree tree(scene.nodes, scene.entries, scene.instances);
  size_t hits = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3 origin = random_vector(random, 3);
    Ray ray = make_ray(origin, random_vector(random) - origin);
    trace_scene(tree, scene.pages, ray, trace_treelet);
    if (!ray.hit.valid()) continue;
    ++hits;
    const TreeletTriangle triangle = find_triangle(scene.pages[ray.hit.treelet].bytes(), ray.hit.slot);
    EXPECT_EQ(triangle.primitive, ray.hit.primitive);
    EXPECT_EQ(triangle.p1, soup[ray.hit.primitive].p[1]);
    EXPECT_EQ(intersect_known(ray, tree.instance(ray.hit.instance), triangle).t, ray.t);
  }
  EXPECT_GT(hits, 500u);
}

}  // namespace
}  // namespace shoal::testing
