// A picture of ours beside that of an independent path tracer ($SHOAL_DATA/reference, see its README): mean luminance,
// and the error of tiles of 16 x 16 pixels relative to the reference tile plus 2 % of the picture's mean. Used by
// tests/engine/reference_test.cpp and principled_reference_test.cpp.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "engine/build_scene.h"
#include "engine/render.h"
#include "io/image.h"

namespace shoal::testing {

inline constexpr uint32_t kSide = 256, kTile = 16;

inline double luminance(const float* rgb, size_t stride) {
  return 0.2126 * rgb[0] + 0.7152 * rgb[stride] + 0.0722 * rgb[2 * stride];
}

struct Agreement {
  double mean_ratio = 0, tile_error_95 = 0;
};

/// Both pictures as luminance, kSide * kSide.
inline Agreement compare(const std::vector<double>& ours, const std::vector<double>& reference) {
  double sum_ours = 0, sum_reference = 0;
  for (size_t i = 0; i < ours.size(); ++i) sum_ours += ours[i], sum_reference += reference[i];
  const double mean = sum_reference / static_cast<double>(reference.size());
  std::vector<double> errors;
  for (uint32_t ty = 0; ty < kSide; ty += kTile) {
    for (uint32_t tx = 0; tx < kSide; tx += kTile) {
      double a = 0, b = 0;
      for (uint32_t y = ty; y < ty + kTile; ++y) {
        for (uint32_t x = tx; x < tx + kTile; ++x) a += ours[y * kSide + x], b += reference[y * kSide + x];
      }
      a /= kTile * kTile, b /= kTile * kTile;
      errors.push_back(std::abs(a - b) / (b + 0.02 * mean));
    }
  }
  std::sort(errors.begin(), errors.end());
  return {sum_ours / sum_reference, errors[errors.size() * 95 / 100]};
}

class ReferencePicture : public ::testing::Test {
 protected:
  void SetUp() override {
    const char* data = std::getenv("SHOAL_DATA");
    if (data == nullptr) GTEST_SKIP() << "SHOAL_DATA is not set: no reference pictures";
    data_ = data;
    folder_ = std::filesystem::temp_directory_path() / ("shoal-reference-" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override {
    std::error_code code;
    if (!folder_.empty()) std::filesystem::remove_all(folder_, code);
  }

  Agreement render_and_compare(const std::string& folder, const std::string& name, float sky, uint32_t samples) {
    const std::vector<float> rgba = render_scene(folder, name, sky, samples, 32);
    const auto reference = read_exr(posix_file_system(), data_ + "/reference/" + name + ".exr", 1u << 20);
    EXPECT_TRUE(reference.ok()) << reference.error().message;
    return compare(ours(rgba), theirs(reference.value()));
  }

  std::vector<float> render_scene(const std::string& folder, const std::string& name, float sky, uint32_t samples,
                                  uint32_t bounces) {
    FileSystem& fs = posix_file_system();
    const std::string shoal = (folder_ / (name + ".shoal")).string();
    const auto built = build_scene(fs, data_ + "/scenes/" + folder + "/" + name + ".gltf", shoal, {});
    EXPECT_TRUE(built.ok()) << built.error().message;
    const auto scene = open_scene(fs, shoal, ReadMode::kBuffered, {});
    EXPECT_TRUE(scene.ok()) << scene.error().message;
    PictureOptions picture;
    picture.width = picture.height = kSide;
    picture.samples = samples;
    picture.shading.bounces = bounces;
    picture.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(sky), {}};
    const auto result = render(fs, scene.value(), picture, {});
    EXPECT_TRUE(result.ok()) << result.error().message;
    return result.value().rgba;
  }

 private:
  static std::vector<double> ours(const std::vector<float>& rgba) {
    std::vector<double> values;
    for (size_t i = 0; i < rgba.size(); i += 4) values.push_back(luminance(&rgba[i], 1));
    return values;
  }
  static std::vector<double> theirs(const ExrImage& image) {
    const auto channel = [&](const char* name) -> const std::vector<float>& {
      return std::find_if(image.channels.begin(), image.channels.end(), [&](const ExrChannel& c) {
               return c.name == name;
             })->values;
    };
    std::vector<double> values;
    for (size_t i = 0; i < channel("R").size(); ++i) {
      const float rgb[3] = {channel("R")[i], channel("G")[i], channel("B")[i]};
      values.push_back(luminance(rgb, 1));
    }
    return values;
  }

  std::string data_;
  std::filesystem::path folder_;
};

inline void expect_agreement(const Agreement& agreement, double mean_tolerance, double tile_tolerance) {
  ::testing::Test::RecordProperty("mean_ratio", std::to_string(agreement.mean_ratio));
  ::testing::Test::RecordProperty("tile_error_95", std::to_string(agreement.tile_error_95));
  std::printf("mean ratio %.4f, 95th percentile of tile errors %.4f\n", agreement.mean_ratio, agreement.tile_error_95);
  EXPECT_NEAR(agreement.mean_ratio, 1, mean_tolerance);
  EXPECT_LE(agreement.tile_error_95, tile_tolerance);
}

}  // namespace shoal::testing
