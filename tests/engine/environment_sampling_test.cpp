// Environment pictures: orientation, filtering, distribution; and whole paths lit by one.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/environment.h"
#include "engine/math.h"
#include "engine/sampler.h"
#include "io/image.h"
#include "tests/support/shading_scene.h"

namespace shoal {
namespace {

using namespace testing;

ImageF picture(uint32_t width, uint32_t height, Vec3 (*value)(float u, float v)) {
  ImageF image{width, height, {}};
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      const Vec3 c = value((static_cast<float>(x) + 0.5f) / static_cast<float>(width),
                           (static_cast<float>(y) + 0.5f) / static_cast<float>(height));
      image.rgb.insert(image.rgb.end(), {c.x, c.y, c.z});
    }
  }
  return image;
}

/// A bright spot in a dim sky.
Vec3 sky(float u, float v) {
  return std::abs(u - 0.7f) < 0.05f && std::abs(v - 0.3f) < 0.05f ? Vec3(50, 40, 30) : Vec3(0.1f + v, 0.2f, u);
}

TEST(Environment, DirectionsFollowTheDocumentedAxes) {
  const Environment e(picture(64, 32, [](float u, float v) { return Vec3(u, v, 0); }));
  const auto expect_at = [&](const Vec3& direction, float u, float v) {
    const Vec3 c = e.radiance(direction);
    EXPECT_NEAR(c.x, u, 1e-4f);
    EXPECT_NEAR(c.y, v, 1e-4f);
  };
  expect_at({0, 0, -1}, 0.5f, 0.5f);
  expect_at({1, 0, 0}, 0.75f, 0.5f);
  expect_at({-1, 0, 0}, 0.25f, 0.5f);
  expect_at(glm::normalize(Vec3(0, 1, -1)), 0.5f, 0.25f);
  expect_at(glm::normalize(Vec3(0.5f, -1, -0.5f)), 0.625f, 0.5f + std::atan(std::sqrt(2.0f)) / kPi);
}

TEST(Environment, TheSeamBehindIsInterpolatedAcross) {
  const Environment e(picture(8, 4, [](float u, float) { return Vec3(u < 0.5f ? 1 : 3); }));
  EXPECT_NEAR(e.radiance({0, 0, 1}).x, 2, 1e-4f);
}

TEST(Environment, TheDensityIntegratesToOneAndIsTheOneSampled) {
  const Environment e(picture(48, 24, sky));
  constexpr int kRows = 24, kColumns = 48, kDraws = 100000;
  std::vector<double> expected(kRows * kColumns), drawn(kRows * kColumns);
  double integral = 0;
  for (int y = 0; y < kRows * 8; ++y) {
    for (int x = 0; x < kColumns * 8; ++x) {
      const double theta = M_PI * (y + 0.5) / (kRows * 8), phi = 2 * M_PI * (x + 0.5) / (kColumns * 8) - M_PI;
      const Vec3 d(std::sin(theta) * std::sin(phi), std::cos(theta), -std::sin(theta) * std::cos(phi));
      const double part = e.pdf(d) * std::sin(theta) * (2 * M_PI * M_PI) / (kRows * kColumns * 64);
      expected[y / 8 * kColumns + x / 8] += part, integral += part;
    }
  }
  EXPECT_NEAR(integral, 1, 1e-3);
  for (uint32_t i = 0; i < kDraws; ++i) {
    const Random4 r = random4(3, i, 0, 0, Dimension::kLight);
    float pdf = 0;
    const Vec3 d = e.sample(r.uniform(0), r.uniform(1), &pdf);
    ASSERT_NEAR(glm::length(d), 1, 1e-5f);
    const double u = 0.5 + std::atan2(d.x, -d.z) / (2 * M_PI), v = std::acos(d.y) / M_PI;
    drawn[std::min(kRows - 1, static_cast<int>(v * kRows)) * kColumns +
          std::min(kColumns - 1, static_cast<int>(u * kColumns))] += 1;
  }
  double chi2 = 0;
  int freedom = 0;
  for (size_t i = 0; i < expected.size(); ++i) {
    const double n = expected[i] * kDraws;
    if (n >= 5) chi2 += (drawn[i] - n) * (drawn[i] - n) / n, ++freedom;
  }
  EXPECT_GT(freedom, 500);
  EXPECT_LT(chi2, freedom + 6 * std::sqrt(2.0 * freedom));
}

TEST(Environment, ItTurnsCounterClockwiseSeenFromAbove) {
  const auto facing = [](float u, float) { return Vec3(std::abs(u - 0.5f) < 0.1f ? 1 : 0); };
  const auto seen = [&](float degrees, const Vec3& along) {
    return Environment(picture(64, 32, facing), degrees).radiance(along).x;
  };
  EXPECT_EQ(seen(0, {0, 0, -1}), 1);
  EXPECT_EQ(seen(90, {0, 0, -1}), 0);
  EXPECT_EQ(seen(90, {-1, 0, 0}), 1);
  EXPECT_EQ(seen(180, {0, 0, 1}), 1);
  EXPECT_EQ(seen(-90, {1, 0, 0}), 1);
  EXPECT_EQ(seen(720 + 90, {-1, 0, 0}), 1);
  // The seam of the picture, which a turn brings to the front, is interpolated across.
  const Environment halves(picture(8, 4, [](float u, float) { return Vec3(u < 0.5f ? 1 : 3); }), 180);
  EXPECT_NEAR(halves.radiance({0, 0, -1}).x, 2, 1e-5);
}

TEST(Environment, ATurnedOneIsSampledWhereItIsBright) {
  for (const float degrees : {-30.0f, 77.0f, 180.0f, 359.9f}) {
    const Environment e(picture(48, 24, sky), degrees);
    double inverse = 0;
    int other_texel = 0;
    constexpr uint32_t kSamples = 40000;
    for (uint32_t i = 0; i < kSamples; ++i) {
      const Random4 r = random4(3, i, 0, 0, Dimension::kLight);
      float pdf = 0;
      const Vec3 d = e.sample(r.uniform(1), r.uniform(2), &pdf);
      if (!(pdf > 0)) continue;
      if (std::abs(e.pdf(d) / pdf - 1) > 1e-3f) ++other_texel;
      inverse += 1 / double{pdf} / kSamples;
    }
    EXPECT_LT(other_texel, 40) << "at the edge of a texel rounding may take the next";
    EXPECT_NEAR(inverse / (4 * kPi), 1, 0.05);
  }
}

TEST(Environment, IntensityMultipliesTheRadianceAndNothingElse) {
  const Environment one(picture(48, 24, sky)), five(picture(48, 24, sky), 0, 5);
  const Vec3 d = glm::normalize(Vec3(0.3f, 0.5f, -0.4f));
  EXPECT_NEAR(five.radiance(d).y / one.radiance(d).y, 5, 1e-5);
  EXPECT_NEAR(five.mean_luminance() / one.mean_luminance(), 5, 1e-5);
  EXPECT_NEAR(five.pdf(d) / one.pdf(d), 1, 1e-5);
  EXPECT_FALSE(Environment(picture(4, 2, [](float, float) { return Vec3(1); }), 0, 0).sampled());
}

TEST(Environment, HostileTexelsAreTamed) {
  ImageF image{4, 2, std::vector<float>(24, 1.0f)};
  image.rgb[0] = std::numeric_limits<float>::quiet_NaN(), image.rgb[4] = -3, image.rgb[8] = 1e38f * 1e38f;
  const Environment e(std::move(image));
  EXPECT_TRUE(std::isfinite(e.mean_luminance()));
  EXPECT_TRUE(e.sampled());
  float pdf = 0;
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(std::isfinite(e.radiance(e.sample(i * 0.01, 0.3, &pdf)).x));
}

TEST(Environment, ABlackPictureIsNeverSampled) {
  const Environment e(picture(4, 2, [](float, float) { return Vec3(0); }));
  EXPECT_FALSE(e.sampled());
  EXPECT_EQ(e.pdf({0, 1, 0}), 0);
}

/// Irradiance on a floor (normal +y) by summing the picture's own interpolant.
Vec3 irradiance(const Environment& e) {
  constexpr int kRows = 400, kColumns = 800;
  glm::dvec3 sum(0);
  for (int y = 0; y < kRows / 2; ++y) {
    for (int x = 0; x < kColumns; ++x) {
      const double theta = M_PI * (y + 0.5) / kRows, phi = 2 * M_PI * (x + 0.5) / kColumns;
      const Vec3 d(std::sin(theta) * std::sin(phi), std::cos(theta), -std::sin(theta) * std::cos(phi));
      sum += glm::dvec3(e.radiance(d)) * (std::cos(theta) * std::sin(theta) * 2 * M_PI * M_PI / (kRows * kColumns));
    }
  }
  return Vec3(sum);
}

TEST(Environment, PathsUnderAPictureEstimateItsIrradiance) {
  TriangleSoup soup;
  add_rectangle(soup, {-50, 0, -50}, {100, 0, 0}, {0, 0, 100}, 0);
  ShadingScene s(std::move(soup), {matte(Vec3(0.5f))});
  const ImageF image = picture(48, 24, sky);
  // Radiance .hdr would round; OpenEXR keeps floats.
  ExrImage exr;
  exr.width = image.width, exr.height = image.height;
  for (size_t c = 0; c < 3; ++c) {
    ExrChannel channel{std::string(1, "RGB"[c]), false, {}};
    for (size_t i = 0; i < image.rgb.size(); i += 3) channel.values.push_back(image.rgb[i + c]);
    exr.channels.push_back(channel);
  }
  ASSERT_TRUE(write_exr(s.files, "sky.exr", exr).ok());
  ShadingOptions options;
  options.environment.kind = EnvironmentOptions::Kind::kImage;
  options.environment.path = "sky.exr";
  s.prepare(options);
  EXPECT_TRUE(s.tables->has_lights());
  const Vec3 expected = irradiance(Environment(image)) * (0.5f / kPi);
  const Vec3 found = s.mean_radiance({0, 1, 0}, {0, -1, 0}, 20000);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c], expected[c], 0.02 * expected[c]);
}

TEST(Environment, AMissingPictureIsAnInputError) {
  Scene scene;
  MemoryFileSystem files;
  ShadingOptions options;
  options.environment.kind = EnvironmentOptions::Kind::kImage;
  options.environment.path = "nowhere.hdr";
  const auto tables = ShadingTables::create(files, scene, options);
  ASSERT_FALSE(tables.ok());
  EXPECT_EQ(tables.error().code, ErrorCode::kInput);
}

}  // namespace
}  // namespace shoal
