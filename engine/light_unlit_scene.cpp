#include "engine/light_unlit_scene.h"

#include "engine/camera.h"

namespace shoal {
namespace {

/// A mean radiance below this, under a sky of 1, means that the sky does not get in.
constexpr double kDarkMean = 0.01;

Result<bool> sky_is_closed_off(FileSystem& fs, const Scene& scene, const PictureOptions& picture,
                               const ExecutionOptions& execution) {
  PictureOptions probe = picture;
  probe.width = probe.height = 16;
  probe.samples = 4;
  SHOAL_ASSIGN_OR_RETURN(const RenderResult result, render(fs, scene, probe, execution));
  double sum = 0;
  for (size_t i = 0; i < result.rgba.size(); ++i) sum += i % 4 == 3 ? 0 : result.rgba[i];
  return sum / (3.0 * 16 * 16) < kDarkMean;
}

/// At the camera, bright enough that a surface of albedo 0.5 a quarter of the scene's diagonal away has a radiance of 0.6.
PunctualLight camera_lamp(const Scene& scene, const PictureOptions& picture) {
  const CameraRecord camera =
      scene.cameras.empty() ? frame_camera(scene.top_tree.bounds()) : scene.cameras[picture.camera];
  const Vec3 extent = scene.top_tree.bounds().extent();
  const float intensity = 0.25f * glm::dot(extent, extent);
  PunctualLight lamp{};
  lamp.type = PunctualType::kPoint;
  for (int c = 0; c < 3; ++c) {
    lamp.position[c] = camera.camera_to_world.translation[c];
    lamp.intensity[c] = intensity;
  }
  lamp.direction[2] = -1;
  return lamp;
}

}  // namespace

Result<UnlitChoice> light_unlit_scene(FileSystem& fs, Scene& scene, PictureOptions& picture,
                                      const ExecutionOptions& execution) {
  if (!scene.emitters.empty() || !scene.lights.empty()) return UnlitChoice::kHasLight;
  picture.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(1), {}};
  SHOAL_ASSIGN_OR_RETURN(const bool closed, sky_is_closed_off(fs, scene, picture, execution));
  if (!closed) return UnlitChoice::kSky;
  scene.lights.push_back(camera_lamp(scene, picture));
  return UnlitChoice::kSkyAndLamp;
}

}  // namespace shoal
