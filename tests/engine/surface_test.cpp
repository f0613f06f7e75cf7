// From a hit to normals, tangents and attributes, on planes whose answers are known.
#include "engine/surface.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/material_sample.h"
#include "tests/support/shading_scene.h"

namespace shoal {
namespace {

using namespace testing;

/// What a corner carries; what is not set is not stored.
struct CornerValues {
  std::optional<Vec3> normal;
  std::optional<Vec4> tangent, color;
  std::optional<Vec2> uv;
};

/// One large triangle in y = 0 around the origin; `corner` gives the attributes at a position.
TriangleSoup floor_triangle(CornerValues (*corner)(const Vec3& p), bool clockwise = false) {
  TriangleSoup soup;
  const Vec3 a(-8, 0, 6), b(8, 0, 6), c(0, 0, -9);  // counter-clockwise from above
  add_triangle(soup, a, clockwise ? c : b, clockwise ? b : c);
  const CornerValues sample = corner(a);
  soup.layout = {sample.normal.has_value(), sample.tangent.has_value(), sample.color.has_value(),
                 static_cast<uint8_t>(sample.uv ? 1 : 0)};
  for (size_t k = 0; k < 3; ++k) {
    const float* p = soup.positions.data() + 3 * k;
    const CornerValues v = corner({p[0], p[1], p[2]});
    if (v.normal) soup.corners.insert(soup.corners.end(), {v.normal->x, v.normal->y, v.normal->z});
    if (v.tangent)
      soup.corners.insert(soup.corners.end(), {v.tangent->x, v.tangent->y, v.tangent->z, v.tangent->w});
    if (v.color) soup.corners.insert(soup.corners.end(), {v.color->x, v.color->y, v.color->z, v.color->w});
    if (v.uv) soup.corners.insert(soup.corners.end(), {v.uv->x, v.uv->y});
  }
  return soup;
}

CornerValues nothing(const Vec3&) { return {}; }
CornerValues plain_uv(const Vec3& p) { return {{}, {}, {}, Vec2(p.x, p.z)}; }  // u right, v down, seen from above
CornerValues mirrored_uv(const Vec3& p) { return {{}, {}, {}, Vec2(-p.x, p.z)}; }
CornerValues with_tangents(const Vec3& p) { return {Vec3(0, 1, 0), Vec4(1, 0, 0, 1), {}, Vec2(p.x, p.z)}; }
CornerValues with_left_handed_tangents(const Vec3& p) {
  return {Vec3(0, 1, 0), Vec4(-1, 0, 0, -1), {}, Vec2(-p.x, p.z)};
}
CornerValues colored(const Vec3& p) { return {{}, {}, Vec4(p.x, p.z, 0, 1), {}}; }
CornerValues outward(const Vec3& p) { return {glm::normalize(Vec3(p.x, 6, p.z)), {}, {}, {}}; }

Surface surface_at(const ShadingScene& s, const Vec3& origin, const Vec3& target) {
  PathState path;
  path.origin = origin, path.direction = target - origin;
  const Ray ray = s.trace(origin, path.direction, kRayInfinity, false);
  EXPECT_TRUE(ray.hit.valid());
  path.hit = ray.hit, path.t = ray.t;
  return find_surface(path, s.scene.top_tree.instance(ray.hit.instance), s.geometry[ray.hit.treelet].bytes(),
                      s.attributes[ray.hit.treelet].bytes());
}

void expect_near(const Vec3& a, const Vec3& b, float tolerance = 2e-6f) {
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(a[axis], b[axis], tolerance) << "axis " << axis;
}

const Vec3 kAbove(1, 4, -2), kBelow(1, -4, -2), kPoint(0.5f, 0, 0.25f);
constexpr Vec3 kTiltU(0.6f, 0, 0.8f), kTiltV(0, 0.6f, 0.8f);

TEST(Surface, FindsThePointAndTurnsTheFaceToTheRay) {
  for (const bool clockwise : {false, true}) {
    const ShadingScene s(floor_triangle(nothing, clockwise), {matte(Vec3(1))});
    const Surface above = surface_at(s, kAbove, kPoint), below = surface_at(s, kBelow, kPoint);
    expect_near(above.position.point, kPoint);
    expect_near(above.geometric_normal, {0, 1, 0});
    expect_near(below.geometric_normal, {0, -1, 0});
    expect_near(above.front_normal, {0, clockwise ? -1.0f : 1.0f, 0});
    expect_near(facing_normal(above, above.front_normal), {0, 1, 0});
    expect_near(facing_normal(below, below.front_normal), {0, -1, 0});
  }
}

TEST(Surface, TangentsComeFromUvOrCornersAndAgree) {
  for (CornerValues (*corner)(const Vec3&) : {plain_uv, with_tangents}) {
    const Surface s = surface_at(ShadingScene(floor_triangle(corner), {matte(Vec3(1))}), kAbove, kPoint);
    expect_near(map_normal(s, kTiltU, 0), {0.6f, 0.8f, 0});
    expect_near(map_normal(s, kTiltV, 0), {0, 0.8f, -0.6f});  // +y of a normal map is up in the picture: -v
  }
  for (CornerValues (*corner)(const Vec3&) : {mirrored_uv, with_left_handed_tangents}) {
    const Surface s = surface_at(ShadingScene(floor_triangle(corner), {matte(Vec3(1))}), kAbove, kPoint);
    expect_near(map_normal(s, kTiltU, 0), {-0.6f, 0.8f, 0});
    expect_near(map_normal(s, kTiltV, 0), {0, 0.8f, -0.6f});
  }
}

TEST(Surface, AMirroringTransformMirrorsTheMappedNormal) {
  const Affine3 mirror{{-1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 0}};
  for (CornerValues (*corner)(const Vec3&) : {plain_uv, with_tangents}) {
    const Surface s = surface_at(ShadingScene(floor_triangle(corner), {matte(Vec3(1))}, mirror), kAbove, kPoint);
    expect_near(s.front_normal, {0, 1, 0});
    expect_near(map_normal(s, kTiltU, 0), {-0.6f, 0.8f, 0});
    expect_near(map_normal(s, kTiltV, 0), {0, 0.8f, -0.6f});
  }
}

TEST(Surface, TheBackOfAMappedFaceIsItsFrontTurnedRound) {
  const Surface s = surface_at(ShadingScene(floor_triangle(with_tangents), {matte(Vec3(1))}), kBelow, kPoint);
  expect_near(facing_normal(s, map_normal(s, kTiltU, 0)), {-0.6f, -0.8f, 0});
}

TEST(Surface, WithoutUvAMappedNormalStays) {
  const Surface s = surface_at(ShadingScene(floor_triangle(nothing), {matte(Vec3(1))}), kAbove, kPoint);
  expect_near(map_normal(s, kTiltU, 0), {0, 1, 0});
  expect_near(map_normal(s, kTiltU, 7), {0, 1, 0});
}

TEST(Surface, NormalsFollowTheInverseTranspose) {
  const Affine3 squash{{1, 0, 0}, {0, 0.25f, 0}, {0, 0, 1}, {0, 0, 0}};
  const ShadingScene s(floor_triangle(outward), {matte(Vec3(1))}, squash);
  const Surface at = surface_at(s, kAbove, kPoint);
  // Interpolated in object space, then y is divided by the scale.
  const Vec3 n = at.front_normal * (1 / at.front_normal.y);
  const ShadingScene round(floor_triangle(outward), {matte(Vec3(1))});
  const Surface plain = surface_at(round, kAbove, kPoint);
  const Vec3 m = plain.front_normal * (1 / plain.front_normal.y);
  expect_near(n, {m.x * 0.25f, 1, m.z * 0.25f}, 1e-5f);
}

TEST(Surface, TheShadingNormalIsNeverSeenFromBehind) {
  const ShadingScene s(floor_triangle(outward), {matte(Vec3(1))});
  for (int i = 1; i < 200; ++i) {
    const float angle = static_cast<float>(i) * (1.57f / 200);
    const Vec3 target(1, 0, 1), eye = target + 3.0f * Vec3(-std::cos(angle), std::sin(angle), -0.3f);
    const Surface at = surface_at(s, eye, target);
    for (const Vec3& n : {at.front_normal, glm::normalize(Vec3(1, 0.05f, 0.4f)), Vec3(1, 0, 0)}) {
      const Vec3 normal = facing_normal(at, n);
      EXPECT_NEAR(glm::length(normal), 1, 1e-5f);
      EXPECT_GE(glm::dot(normal, at.wo), 0.999f * kMinViewRatio * glm::dot(at.geometric_normal, at.wo));
      EXPECT_GT(glm::dot(normal, at.geometric_normal), -1e-5f);
    }
  }
}

TEST(Surface, VertexColoursAreInterpolatedAndMultiplyTheBaseColour) {
  ShadingScene s(floor_triangle(colored), {matte({0.5f, 1, 1})});
  s.prepare({});
  const Surface at = surface_at(s, kAbove, kPoint);
  expect_near(Vec3(at.color()), {0.5f, 0.25f, 0}, 1e-5f);
  TextureSampler textures(s.scene.textures, *s.cache);
  uint64_t lookups = 0;
  TextureContext context{textures, s.cache_counters, lookups};
  const Result<MaterialSample> sample = sample_material(s.scene.materials[0], at, context);
  ASSERT_TRUE(sample.ok());
  expect_near(sample.value().base_color, {0.25f, 0.25f, 0}, 1e-5f);
  EXPECT_EQ(lookups, 0);
}

TEST(Surface, EveryTextureMultipliesItsOwnFactor) {
  ShadingScene s(floor_triangle(plain_uv), {matte(Vec3(1))});
  Material& m = s.scene.materials[0];
  const auto one_texel = [&](uint8_t r, uint8_t g, uint8_t b, uint8_t a, bool srgb) {
    return TextureSlot{s.add_texture(1, 1, {r, g, b, a}, srgb), 0};
  };
  m.base_color_texture = one_texel(255, 0, 255, 10, true);
  m.metallic_roughness_texture = one_texel(7, 51, 102, 9, false);
  m.specular_texture = one_texel(1, 2, 3, 153, false);
  m.specular_color_texture = one_texel(255, 255, 0, 1, true);
  m.normal_texture = one_texel(204, 127, 230, 255, false);
  m.metallic = 0.5f, m.roughness = 0.5f, m.specular = 0.5f, m.normal_scale = 1;
  s.prepare({});
  const Surface at = surface_at(s, kAbove, kPoint);
  TextureSampler textures(s.scene.textures, *s.cache);
  uint64_t lookups = 0;
  TextureContext context{textures, s.cache_counters, lookups};
  const MaterialSample sample = sample_material(m, at, context).value();
  expect_near(sample.base_color, {1, 0, 1});
  EXPECT_NEAR(sample.roughness, 0.1f, 1e-6f);
  EXPECT_NEAR(sample.metallic, 0.2f, 1e-6f);
  EXPECT_NEAR(sample.specular, 0.3f, 1e-6f);
  expect_near(sample.specular_color, {1, 1, 0});
  const Vec3 normal = sample_normal(m, at, context).value();
  expect_near(normal, glm::normalize(Vec3(0.6f, 2 * 230 / 255.0f - 1, 1 / 255.0f)), 1e-4f);
  EXPECT_EQ(lookups, 5);
}

}  // namespace
}  // namespace shoal
