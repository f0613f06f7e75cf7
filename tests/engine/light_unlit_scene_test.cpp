#include "engine/light_unlit_scene.h"

#include <gtest/gtest.h>

#include "tests/engine/built_scene.h"

namespace shoal {
namespace {

using testing::BuiltScene;
using testing::WrittenScene;

/// A cube around the origin as one mesh, or without its top.
std::vector<float> cube_triangles(bool closed) {
  std::vector<float> positions;
  const auto quad = [&](const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
    for (const Vec3& p : {a, b, c, a, c, d}) positions.insert(positions.end(), {p.x, p.y, p.z});
  };
  const auto corner = [](int i) { return Vec3(i & 1 ? 2 : -2, i & 2 ? 2 : -2, i & 4 ? 2 : -2); };
  quad(corner(0), corner(2), corner(6), corner(4));
  quad(corner(1), corner(3), corner(7), corner(5));
  quad(corner(0), corner(1), corner(3), corner(2));
  quad(corner(4), corner(5), corner(7), corner(6));
  quad(corner(0), corner(1), corner(5), corner(4));
  if (closed) quad(corner(2), corner(3), corner(7), corner(6));
  return positions;
}

BuiltScene cube_with_camera_inside(bool closed) {
  MemoryFileSystem fs;
  WrittenScene written;
  const uint32_t positions = written.add_floats(3, cube_triangles(closed));
  written.json["materials"] = {{{"pbrMetallicRoughness", {{"metallicFactor", 0}}}}};
  written.add_mesh({{"attributes", {{"POSITION", positions}}}, {"material", 0}});
  written.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 1.0}, {"znear", 0.1}}}}};
  written.add_node({{"mesh", 0}});
  written.add_node({{"camera", 0}});
  written.save(fs);
  return testing::build_and_open(fs);
}

UnlitChoice choose(BuiltScene& built, PictureOptions& picture) {
  ExecutionOptions execution;
  execution.threads = 1;
  const auto choice = light_unlit_scene(posix_file_system(), built.scene, picture, execution);
  EXPECT_TRUE(choice.ok()) << choice.error().message;
  return choice.value();
}

TEST(LightUnlitScene, GivesASkyWhereItGetsIn) {
  BuiltScene built = cube_with_camera_inside(false);
  PictureOptions picture;
  EXPECT_EQ(choose(built, picture), UnlitChoice::kSky);
  EXPECT_TRUE(built.scene.lights.empty());
  EXPECT_EQ(picture.shading.environment.kind, EnvironmentOptions::Kind::kConstant);
}

TEST(LightUnlitScene, PutsALampAtTheCameraWhereTheSkyIsClosedOff) {
  BuiltScene built = cube_with_camera_inside(true);
  PictureOptions picture;
  picture.width = picture.height = 8;
  EXPECT_EQ(choose(built, picture), UnlitChoice::kSkyAndLamp);
  ASSERT_EQ(built.scene.lights.size(), 1u);
  const auto result = render(posix_file_system(), built.scene, picture, {});
  ASSERT_TRUE(result.ok()) << result.error().message;
  for (size_t i = 0; i < result.value().rgba.size(); i += 4) EXPECT_GT(result.value().rgba[i], 0.01f);
}

}  // namespace
}  // namespace shoal
