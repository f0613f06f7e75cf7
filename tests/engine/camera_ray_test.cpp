#include <gtest/gtest.h>

#include "engine/camera.h"

namespace shoal {
namespace {

/// Random numbers that put the sample in the middle of the pixel.
constexpr Random4 kMiddle{{0x80000000u, 0x80000000u, 0, 0}};
constexpr Random4 kCorner{{0, 0, 0, 0}};

CameraRecord perspective(float tan_half_yfov) {
  CameraRecord record{};
  record.perspective = 1;
  record.tan_half_yfov = tan_half_yfov;
  return record;
}

void expect_near(const Vec3& a, const Vec3& b, float tolerance = 1e-6f) {
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(a[axis], b[axis], tolerance) << "axis " << axis;
}

TEST(Camera, LooksAlongMinusZWithRowsFromTheTop) {
  const Camera camera(perspective(1), 4, 2);
  expect_near(camera.ray(0, 0, kCorner).direction, glm::normalize(Vec3(-2, 1, -1)));
  expect_near(camera.ray(2, 1, kCorner).direction, Vec3(0, 0, -1));
  expect_near(camera.ray(3, 1, kMiddle).direction, glm::normalize(Vec3(1.5f, -0.5f, -1)));
}

TEST(Camera, KeepsTheVerticalAngleWhateverTheWidth) {
  for (const uint32_t width : {1u, 50u, 400u}) {
    const CameraRay top = Camera(perspective(0.5f), width, 100).ray(0, 0, kCorner);
    EXPECT_NEAR(top.direction.y / -top.direction.z, 0.5f, 1e-6f);
    EXPECT_NEAR(top.direction.x / top.direction.z, 0.5f * static_cast<float>(width) / 100, 1e-5f);
  }
}

TEST(Camera, SamplesEveryPixelInsideItsOwnArea) {
  const Camera camera(perspective(1), 8, 8);
  for (uint32_t sample = 0; sample < 1000; ++sample) {
    const CameraRay ray = camera.ray(5, 2, random4(1, 21, sample, 0, Dimension::kPixel));
    const float x = (ray.direction.x / -ray.direction.z + 1) * 4, y = (1 - ray.direction.y / -ray.direction.z) * 4;
    EXPECT_TRUE(x >= 4.9999f && x <= 6.0001f && y >= 1.9999f && y <= 3.0001f) << x << " " << y;
    EXPECT_NEAR(glm::length(ray.direction), 1, 1e-6f);
  }
}

TEST(Camera, IgnoresTheScaleOfItsNode) {
  CameraRecord record = perspective(1);
  record.camera_to_world = {{3, 0, 0}, {0, 5, 0}, {0, 0, 0.1f}, {7, 8, 9}};
  const CameraRay ray = Camera(record, 4, 4).ray(0, 0, kCorner);
  expect_near(ray.direction, glm::normalize(Vec3(-1, 1, -1)));
  expect_near(ray.origin, {7, 8, 9});
}

TEST(Camera, OrthographicRaysAreParallelAndSpanTwiceTheMagnification) {
  CameraRecord record{};
  record.ymag = 3;
  record.camera_to_world.translation = {0, 0, 10};
  const CameraRay ray = Camera(record, 20, 10).ray(0, 0, kCorner);
  expect_near(ray.origin, {-6, 3, 10});
  expect_near(ray.direction, {0, 0, -1});
}

TEST(Camera, FramingShowsEveryCornerOfTheBounds) {
  Bounds3 bounds;
  bounds.include(Vec3(-3, 10, 2)), bounds.include(Vec3(40, 11, 5));
  const CameraRecord record = frame_camera(bounds);
  const Affine3& m = record.camera_to_world;
  for (int i = 0; i < 8; ++i) {
    const Vec3 corner((i & 1) ? bounds.lo.x : bounds.hi.x, (i & 2) ? bounds.lo.y : bounds.hi.y,
                      (i & 4) ? bounds.lo.z : bounds.hi.z);
    const Vec3 local = m.transposed_vector(corner - m.translation);
    ASSERT_LT(local.z, 0);
    EXPECT_LE(std::abs(local.x), -local.z * record.tan_half_yfov * 1.0001f);
    EXPECT_LE(std::abs(local.y), -local.z * record.tan_half_yfov * 1.0001f);
  }
}

TEST(Camera, StandsAtItsKeysAndGoesStraightBetweenThem) {
  const std::vector<Affine3> keys = {{{2, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}},
                                     {{0.8f, 0, -0.6f}, {0, 1, 0}, {0.6f, 0, 0.8f}, {4, 0, 0}},
                                     {{-0.8f, 0, -0.6f}, {0, 1, 0}, {0.6f, 0, -0.8f}, {8, 2, 0}}};
  const Camera camera(perspective(1), 4, 4, {}, keys);
  ASSERT_TRUE(camera.moves());
  const auto middle = [&](float time) {
    const Camera now = camera.at(time);
    EXPECT_FALSE(now.moves());
    return now.ray(2, 2, kCorner);
  };
  expect_near(middle(0).direction, {0, 0, -1});
  expect_near(middle(0.5f).direction, {-0.6f, 0, -0.8f});
  expect_near(middle(0.5f).origin, {4, 0, 0});
  // Half the way from the first key, however long its axes are.
  expect_near(middle(0.25f).origin, {2, 0, 0});
  expect_near(middle(0.25f).direction, glm::normalize(Vec3(-0.3f, 0, -0.9f)));
  // From the second to the third its axes turn by more than 45 degrees: it waits for that.
  expect_near(middle(0.9f).origin, {4, 0, 0});
  expect_near(middle(0.9f).direction, {-0.6f, 0, -0.8f});
  EXPECT_FALSE(Camera(perspective(1), 4, 4).moves());
}

TEST(Camera, FramingNothingStillGivesACamera) {
  const CameraRecord record = frame_camera(Bounds3{});
  EXPECT_TRUE(std::isfinite(glm::length(record.camera_to_world.translation)));
  EXPECT_GT(record.tan_half_yfov, 0);
}

}  // namespace
}  // namespace shoal
