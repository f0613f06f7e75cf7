// A hall with boxes, lit by any number of lights of the same power altogether: half of them emissive squares that face
// anywhere, half of them point lights. The camera looks below them: the edges of lamps in a picture are noise that no
// choice of lights changes. For bench/many_lights. Pure function of its arguments.
#pragma once

#include <cstdint>
#include <string>

#include "io/result.h"

namespace shoal::bench {

/// Writes lights.gltf and lights.bin into `folder`; returns the path of the glTF. Fails with: kStorage.
Result<std::string> write_light_scene(const std::string& folder, uint32_t lights);

}  // namespace shoal::bench
