// Projections, thin lens and distortion against their closed forms.
#include "engine/lens.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/camera.h"

namespace shoal {
namespace {

Random4 at(double u, double v) {
  return {{static_cast<uint32_t>(u * 4294967296.0), static_cast<uint32_t>(v * 4294967296.0), 0, 0}};
}
const Random4 kMiddle = at(0.5, 0.5);

CameraRecord record(bool perspective = true) {
  CameraRecord r{};
  r.perspective = perspective;
  r.tan_half_yfov = 0.5f;
  r.xmag = r.ymag = 2;
  return r;
}

LensOptions projected(Projection projection) {
  LensOptions lens;
  lens.projection = projection;
  return lens;
}

void expect_near(const Vec3& a, const Vec3& b, float tolerance = 2e-6f) {
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(a[axis], b[axis], tolerance) << "axis " << axis;
}

TEST(Lens, WithoutOptionsNoBitOfARayChanges) {
  for (const bool perspective : {true, false}) {
    const Camera plain(record(perspective), 31, 17), pinhole(record(perspective), 31, 17, LensOptions{});
    EXPECT_FALSE(pinhole.has_aperture());
    for (uint32_t i = 0; i < 200; ++i) {
      const Random4 random = random4(1, i, 0, 0, Dimension::kPixel);
      const CameraRay a = plain.ray(i % 31, i % 17, random), b = pinhole.ray(i % 31, i % 17, random, random4(2, i, 3, 4, Dimension::kLens));
      EXPECT_EQ(a.origin, b.origin);
      EXPECT_EQ(a.direction, b.direction);
    }
  }
}

TEST(Lens, AFieldOfViewTurnsAnyCameraIntoAPerspectiveOne) {
  LensOptions lens = projected(Projection::kPerspective);
  lens.fov_degrees = 90;
  for (const bool perspective : {true, false}) {
    const CameraRay top = Camera(record(perspective), 10, 10, lens).ray(5, 0, at(0, 0));
    expect_near(top.direction, glm::normalize(Vec3(0, 1, -1)));
  }
}

TEST(Lens, AnOrthographicPictureIsAsHighAsAskedFor) {
  LensOptions lens = projected(Projection::kOrthographic);
  expect_near(Camera(record(), 8, 4, lens).ray(0, 0, at(0, 0)).origin, {-4, 2, 0});
  lens.height = 10;
  const CameraRay ray = Camera(record(), 8, 4, lens).ray(0, 0, at(0, 0));
  expect_near(ray.origin, {-10, 5, 0});
  expect_near(ray.direction, {0, 0, -1});
}

TEST(Lens, AnEquirectangularPictureIsTheWholeSphere) {
  const Camera camera(record(), 8, 4, projected(Projection::kEquirectangular));
  expect_near(camera.ray(4, 2, at(0, 0)).direction, {0, 0, -1});   // the middle
  expect_near(camera.ray(6, 2, at(0, 0)).direction, {1, 0, 0});    // a quarter to the right
  expect_near(camera.ray(0, 2, at(0, 0)).direction, {0, 0, 1});    // the left border
  expect_near(camera.ray(3, 0, at(0, 0)).direction, {0, 1, 0});    // the top border
  expect_near(camera.ray(2, 1, at(0, 0)).direction, {-std::sqrt(0.5f), std::sqrt(0.5f), 0});
  for (uint32_t i = 0; i < 32; ++i) EXPECT_NEAR(glm::length(camera.ray(i % 8, i / 8, kMiddle).direction), 1, 1e-6f);
}

TEST(Lens, AFisheyesAngleGrowsAsTheDistanceFromTheMiddle) {
  for (const float fov : {90.0f, 180.0f, 360.0f}) {
    LensOptions lens = projected(Projection::kFisheye);
    lens.fov_degrees = fov;
    const Camera camera(record(), 200, 100, lens);
    for (uint32_t x = 51; x < 150; ++x) {
      const CameraRay ray = camera.ray(x, 50, at(0, 0));
      ASSERT_TRUE(ray.seen);
      const double angle = (static_cast<double>(x) - 100) / 50 * fov / 2 * 3.14159265358979 / 180;
      expect_near(ray.direction, {static_cast<float>(std::sin(angle)), 0, static_cast<float>(-std::cos(angle))});
    }
    EXPECT_FALSE(camera.ray(20, 50, kMiddle).seen);
    EXPECT_FALSE(camera.ray(52, 2, kMiddle).seen);
    EXPECT_TRUE(camera.ray(100, 0, kMiddle).seen);
  }
}

TEST(Lens, WhatIsInFocusIsMetFromEveryPointOfTheAperture) {
  LensOptions lens;
  lens.aperture = 0.5f;
  lens.focus_distance = 4;
  for (const bool perspective : {true, false}) {
    CameraRecord r = record(perspective);
    r.camera_to_world.translation = {1, 2, 3};
    const Camera camera(r, 16, 16, lens), pinhole(r, 16, 16);
    ASSERT_TRUE(camera.has_aperture());
    double mean = 0, farthest = 0;
    constexpr int kCount = 4000;
    for (int i = 0; i < kCount; ++i) {
      const CameraRay through = camera.ray(3, 12, kMiddle, random4(7, static_cast<uint32_t>(i), 0, 0, Dimension::kLens));
      const CameraRay straight = pinhole.ray(3, 12, kMiddle);
      const auto on_plane = [](const CameraRay& ray) { return ray.origin + ray.direction * ((-1 - ray.origin.z) / ray.direction.z); };
      expect_near(on_plane(through), on_plane(straight), 1e-5f);
      const double radius = glm::length(through.origin - straight.origin);
      farthest = std::max(farthest, radius), mean += radius / kCount;
    }
    EXPECT_LE(farthest, 0.2500001);
    EXPECT_GT(farthest, 0.24);
    EXPECT_NEAR(mean, 0.25 * 2 / 3, 0.003);  // of a disk covered evenly
  }
}

TEST(Lens, AnFStopIsThatOfSmallFormatFilm) {
  LensOptions lens;
  lens.f_stop = 2;
  lens.focus_distance = 1;
  // A picture 24 mm high at tan 0.5: 24 mm of focal length, so an aperture of 12 mm.
  const Camera camera(record(), 4, 4, lens);
  double farthest = 0;
  for (uint32_t i = 0; i < 2000; ++i) {
    farthest = std::max<double>(farthest, glm::length(camera.ray(0, 0, kMiddle, random4(1, i, 0, 0, Dimension::kLens)).origin));
  }
  EXPECT_NEAR(farthest, 0.006, 0.0001);
}

TEST(Lens, RadialDistortionLooksAlongThePolynomial) {
  LensOptions lens;
  lens.distortion = {DistortionModel::kRadial, {0.22, 0.24, 0, 0, 0, 0}};
  const Camera camera(record(), 100, 100, lens), plain(record(), 100, 100);
  for (uint32_t x = 0; x < 100; x += 7) {
    const Vec3 p = plain.ray(x, 30, kMiddle).direction, d = camera.ray(x, 30, kMiddle).direction;
    const double px = p.x / -p.z, py = p.y / -p.z, r2 = px * px + py * py, factor = 1 + 0.22 * r2 + 0.24 * r2 * r2;
    EXPECT_NEAR(d.x / -d.z, px * factor, 1e-6);
    EXPECT_NEAR(d.y / -d.z, py * factor, 1e-6);
  }
}

TEST(Lens, BrownConradyIsTurnedRound) {
  const Distortion d{DistortionModel::kBrown, {-0.28, 0.08, -0.01, 0.0007, -0.0012, 0}};
  for (double x = -0.6; x <= 0.6; x += 0.1) {
    for (double y = -0.4; y <= 0.4; y += 0.1) {
      const double r2 = x * x + y * y, radial = 1 - 0.28 * r2 + 0.08 * r2 * r2 - 0.01 * r2 * r2 * r2;
      const PlanePoint seen{x * radial + 2 * 0.0007 * x * y - 0.0012 * (r2 + 2 * x * x),
                            y * radial + 0.0007 * (r2 + 2 * y * y) - 2 * 0.0012 * x * y};
      const auto found = distorted(d, seen);
      ASSERT_TRUE(found);
      EXPECT_NEAR(found->x, x, 1e-10);
      EXPECT_NEAR(found->y, y, 1e-10);
    }
  }
}

TEST(Lens, WhereNoDirectionLeadsToAPixelNothingIsSeen) {
  EXPECT_FALSE(distorted({DistortionModel::kBrown, {-0.3, 0, 0, 0, 0, 0}}, {3, 0}));
  EXPECT_FALSE(distorted({DistortionModel::kRadial, {-0.5, 0, 0, 0, 0, 0}}, {3, 0}));
  LensOptions lens;
  lens.distortion = {DistortionModel::kRadial, {-0.5, 0, 0, 0, 0, 0}};
  CameraRecord wide = record();
  wide.tan_half_yfov = 3;
  EXPECT_FALSE(Camera(wide, 10, 10, lens).ray(0, 0, kMiddle).seen);
  EXPECT_TRUE(Camera(wide, 10, 10, lens).ray(5, 5, kMiddle).seen);
}

TEST(Lens, OptionsThatDoNotGoTogetherAreRefused) {
  const auto refused = [](auto change, bool perspective = true) {
    LensOptions lens;
    change(lens);
    const Status status = check_lens(record(perspective), lens);
    return !status.ok() && status.error().code == ErrorCode::kUsage;
  };
  EXPECT_TRUE(check_lens(record(), {}).ok());
  EXPECT_TRUE(check_lens(record(false), {}).ok());
  EXPECT_TRUE(refused([](LensOptions& l) { l.aperture = 1; }));
  EXPECT_TRUE(refused([](LensOptions& l) { l.focus_distance = 1; }));
  EXPECT_FALSE(refused([](LensOptions& l) { l.aperture = 1, l.focus_distance = 1; }));
  EXPECT_FALSE(refused([](LensOptions& l) { l.aperture = 1, l.focus_distance = 1; }, false));
  EXPECT_TRUE(refused([](LensOptions& l) { l.f_stop = 1, l.focus_distance = 1; }, false));
  EXPECT_TRUE(refused([](LensOptions& l) { l.fov_degrees = 60; }, false));
  EXPECT_TRUE(refused([](LensOptions& l) { l.fov_degrees = 180; }));
  EXPECT_TRUE(refused([](LensOptions& l) { l.height = 1; }));
  EXPECT_TRUE(refused([](LensOptions& l) { l.projection = Projection::kFisheye, l.fov_degrees = 361; }));
  EXPECT_TRUE(refused([](LensOptions& l) { l.projection = Projection::kEquirectangular, l.fov_degrees = 90; }));
  EXPECT_TRUE(refused([](LensOptions& l) { l.projection = Projection::kFisheye, l.aperture = l.focus_distance = 1; }));
  EXPECT_TRUE(refused([](LensOptions& l) { l.projection = Projection::kFisheye, l.distortion.model = DistortionModel::kRadial; }));
  EXPECT_TRUE(refused([](LensOptions& l) { l.aperture = -1; }));
  EXPECT_TRUE(refused([](LensOptions& l) { l.fov_degrees = std::nanf(""); }));
}

}  // namespace
}  // namespace shoal
