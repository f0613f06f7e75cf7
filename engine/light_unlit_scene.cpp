#include "engine/light_unlit_scene.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "engine/camera.h"

namespace shoal {
namespace {

/// A mean luminance below this, under a sky of 1, means that the sky does not get in.
constexpr double kDarkMean = 0.01;
/// The lamp makes the median pixel this bright.
constexpr float kLampMedian = 0.2f;

/// Luminances of a picture of 16 x 16 pixels, sorted.
Result<std::vector<float>> probe_luminances(FileSystem& fs, const Scene& scene, const PictureOptions& picture,
                                            const ExecutionOptions& execution) {
  PictureOptions probe = picture;
  probe.width = probe.height = 16;
  probe.samples = 4;
  probe.range = {};
  ExecutionOptions unseen = execution;
  unseen.preview = {};
  unseen.checkpoint = {};
  unseen.sums_path.clear();
  unseen.record = nullptr;
  unseen.touches = nullptr;
  unseen.time_limit_seconds = 0;  // the lamp is that of these samples
  SHOAL_ASSIGN_OR_RETURN(const RenderResult result, render(fs, scene, probe, unseen));
  std::vector<float> values;
  for (size_t i = 0; i < result.rgba.size(); i += 4) {
    values.push_back(0.2126f * result.rgba[i] + 0.7152f * result.rgba[i + 1] + 0.0722f * result.rgba[i + 2]);
  }
  std::sort(values.begin(), values.end());
  return values;
}

PunctualLight lamp_at_camera(const Scene& scene, const PictureOptions& picture) {
  const CameraRecord camera =
      scene.cameras.empty() ? frame_camera(scene.top_tree.bounds()) : scene.cameras[picture.camera];
  PunctualLight lamp{};
  lamp.type = PunctualType::kPoint;
  for (int c = 0; c < 3; ++c) {
    lamp.position[c] = camera.camera_to_world.translation[c];
    lamp.intensity[c] = 1;
  }
  lamp.direction[2] = -1;
  return lamp;
}

}  // namespace

Result<UnlitChoice> light_unlit_scene(FileSystem& fs, Scene& scene, PictureOptions& picture,
                                      const ExecutionOptions& execution) {
  if (!scene.emitters.empty() || !scene.lights.empty()) return UnlitChoice::kHasLight;
  picture.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(1), {}};
  picture.shading.environment.fallback = true;
  SHOAL_ASSIGN_OR_RETURN(const std::vector<float> by_sky, probe_luminances(fs, scene, picture, execution));
  const double sum = std::accumulate(by_sky.begin(), by_sky.end(), 0.0);
  if (sum >= kDarkMean * static_cast<double>(by_sky.size())) return UnlitChoice::kSky;

  scene.lights.push_back(lamp_at_camera(scene, picture));
  SHOAL_ASSIGN_OR_RETURN(const std::vector<float> by_lamp, probe_luminances(fs, scene, picture, execution));
  const float median = by_lamp[by_lamp.size() / 2];
  for (float& channel : scene.lights.back().intensity) channel = median > 0 ? kLampMedian / median : 1;
  return UnlitChoice::kSkyAndLamp;
}

}  // namespace shoal
