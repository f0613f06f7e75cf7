// What lights a scene that has no light of its own: a constant sky, and a lamp at the camera where the scene's own
// geometry closes off the sky (a city under a dome, the inside of a room). Never a black picture.
// Called by bins before rendering. The choice depends on the scene and the camera only. Cost: one or
// two pictures of 16 x 16.
#pragma once

#include "engine/render.h"

namespace shoal {

enum class UnlitChoice : uint8_t { kHasLight, kSky, kSkyAndLamp };

/// Requires: no environment was asked for. Sets picture.shading.environment and may add a point light to scene.lights.
/// Fails with: what render() returns.
Result<UnlitChoice> light_unlit_scene(FileSystem& fs, Scene& scene, PictureOptions& picture,
                                      const ExecutionOptions& execution);

}  // namespace shoal
