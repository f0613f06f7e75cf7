// Emitters with alpha: what is not there gives no light, however light is sampled.
#include <gtest/gtest.h>

#include "engine/render.h"
#include "tests/engine/built_scene.h"

namespace shoal {
namespace {

using testing::BuiltScene;
using testing::WrittenScene;

/// A floor under an emissive square whose base colour has this alpha; the camera sees the floor only.
double mean_radiance(const char* alpha_mode, double alpha) {
  MemoryFileSystem fs;
  WrittenScene written;
  const uint32_t floor = written.add_floats(3, {-9, 0, -9, 9, 0, -9, 9, 0, 9, -9, 0, -9, 9, 0, 9, -9, 0, 9});
  const uint32_t lamp = written.add_floats(3, {-1, 2, -1, 1, 2, -1, 1, 2, 1, -1, 2, -1, 1, 2, 1, -1, 2, 1});
  written.json["materials"] = {
      {{"pbrMetallicRoughness", {{"metallicFactor", 0}}}},
      {{"alphaMode", alpha_mode},
       {"emissiveFactor", {1, 1, 1}},
       {"pbrMetallicRoughness", {{"metallicFactor", 0}, {"baseColorFactor", {0, 0, 0, alpha}}}}}};
  written.add_mesh({{"attributes", {{"POSITION", floor}}}, {"material", 0}});
  written.add_mesh({{"attributes", {{"POSITION", lamp}}}, {"material", 1}});
  written.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 0.1}}}}};
  written.add_node({{"mesh", 0}});
  written.add_node({{"mesh", 1}});
  // At (0, 1, 0) looking down.
  written.add_node({{"camera", 0}, {"translation", {0, 1, 0}}, {"rotation", {-0.70710678, 0, 0, 0.70710678}}});
  written.save(fs);
  const BuiltScene built = testing::build_and_open(fs);
  PictureOptions picture;
  picture.width = picture.height = 24, picture.samples = 64;
  picture.shading.bounces = 1;
  const auto result = render(fs, built.scene, picture, {});
  EXPECT_TRUE(result.ok()) << result.error().message;
  double sum = 0;
  for (size_t i = 0; i < result.value().rgba.size(); i += 4) sum += result.value().rgba[i];
  return sum / (24 * 24);
}

TEST(CoveredEmitter, AnInvisibleOneGivesNoLight) {
  EXPECT_EQ(mean_radiance("MASK", 0), 0);
  EXPECT_EQ(mean_radiance("BLEND", 0), 0);
}

TEST(CoveredEmitter, AHalfTransparentOneGivesHalfTheLight) {
  const double opaque = mean_radiance("OPAQUE", 1);
  EXPECT_GT(opaque, 0.05);
  EXPECT_NEAR(mean_radiance("BLEND", 0.5) / opaque, 0.5, 0.02);
}

}  // namespace
}  // namespace shoal
