// The options that say through what, and when, a scene is seen.
#include "tests/bins/seen_pictures.h"

namespace shoal::testing {
namespace {

TEST(CameraOptions, WhatChangesNothingChangesNoBit) {
  const Pictures pictures;
  const std::vector<float> plain = pictures.render("plain", {});
  EXPECT_EQ(pictures.render("same", {"--projection", "perspective", "--aperture", "0", "--distortion", "0,0"}), plain);
  EXPECT_EQ(pictures.render("start", {"--time", "0"}), plain);
}

TEST(CameraOptions, ALensBlursAndEveryOrderBlursTheSame) {
  const Pictures pictures;
  const std::vector<std::string> lens = {"--aperture", "0.4", "--focus", "1.5"};
  const std::vector<float> plain = pictures.render("plain", {}), blurred = pictures.render("blurred", lens);
  EXPECT_NE(blurred, plain);
  for (const char* order : {"queued", "depth-first", "sorted", "hybrid"}) {
    EXPECT_EQ(pictures.render(order, join(lens, {"--order", order, "--threads", "1"})), blurred) << order;
  }
  EXPECT_NE(pictures.render("stop", {"--aperture", "f/1.4", "--focus", "1.5"}), plain);
}

TEST(CameraOptions, OutsideTheCircleOfAFisheyeThePictureIsBlackAndClear) {
  const Pictures pictures;
  for (const char* order : {"queued", "depth-first", "sorted", "hybrid"}) {
    const std::vector<float> picture = pictures.render("fisheye", {"--projection", "fisheye", "--order", order});
    for (size_t channel = 0; channel < 4; ++channel) EXPECT_EQ(picture[channel * 48 * 32], 0) << channel;
    size_t lit = 0;
    for (size_t i = 0; i < 48 * 32; ++i) lit += picture[2 * 48 * 32 + i] > 0;
    EXPECT_NEAR(static_cast<double>(lit), 3.14159 * 16 * 16, 90);
  }
}

TEST(CameraOptions, ProjectionsDistortionAndTimeChangeThePicture) {
  const Pictures pictures;
  const std::vector<float> plain = pictures.render("plain", {});
  for (const std::vector<std::string>& options :
       {std::vector<std::string>{"--projection", "orthographic", "--ortho-height", "3"}, {"--projection", "equirectangular"},
        {"--fov", "60"}, {"--distortion", "0.9,0.3"}, {"--distortion", "brown:-0.2,0.05,0,0.01,0.01"}, {"--time", "0.5"},
        {"--animation", "leave", "--time", "1"}}) {
    EXPECT_NE(pictures.render("other", options), plain) << options[0] << " " << options[1];
  }
}

TEST(CameraOptions, ABuiltSceneKeepsItsTime) {
  const Pictures pictures;
  expect_exit(run_shoal(pictures.folder, {"build", pictures.folder / "scene/scene.gltf", "-o",
                                          pictures.folder / "later.shoal", "--time", "0.001"}), 0);
  const std::vector<float> direct = pictures.render("direct", {"--time", "0.001"});
  EXPECT_EQ(pictures.render("kept", {}, "later.shoal"), direct);
  EXPECT_EQ(pictures.render("asked", {"--time", "0.001", "--animation", "leave"}, "later.shoal"), direct);
  expect_error(pictures.run("wrong", {"--time", "0"}, "later.shoal"), 2, {"later.shoal was built at 0.001 s", "--time"});
  expect_error(pictures.run("wrong", {"--time", "0", "--animation", "stay"}), 2, {"'stay'", "the scene has 1"});
}

TEST(CameraOptions, WhatDoesNotGoTogetherExitsTwo) {
  const Pictures pictures;
  for (const std::vector<std::string>& options :
       {std::vector<std::string>{"--aperture", "0.1"}, {"--focus", "1"}, {"--projection", "fisheye", "--fov", "400"},
        {"--projection", "equirectangular", "--distortion", "0.1"}, {"--ortho-height", "3"}}) {
    expect_error(pictures.run("wrong", options), 2, {});
  }
  for (const std::vector<std::string>& options :
       {std::vector<std::string>{"--aperture", "f/"}, {"--aperture", "wide"}, {"--distortion", "1,,2"},
        {"--distortion", "brown:1,2,3,4,5,6"}, {"--distortion", ""}, {"--projection", "flat"}}) {
    expect_exit(pictures.run("wrong", options), 2);
  }
}

}  // namespace
}  // namespace shoal::testing
