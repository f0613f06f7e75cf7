// Camera rays: a pixel sample becomes an origin and a direction. Pure functions of their arguments.
#pragma once

#include "engine/sampler.h"
#include "engine/scene.h"

namespace shoal {

struct CameraRay {
  Vec3 origin, direction;  ///< world space, direction of unit length
};

class Camera {
 public:
  /// `record` with a film of width x height; glTF's yfov is vertical; a film wider or higher than the camera's
  /// aspect ratio keeps the vertical angle.
  Camera(const CameraRecord& record, uint32_t width, uint32_t height);
  /// Box filter one pixel wide: the point is uniform in the pixel. Pixel rows run from the top.
  CameraRay ray(uint32_t x, uint32_t y, const Random4& random) const;

 private:
  Affine3 camera_to_world_;
  bool perspective_;
  float scale_x_, scale_y_;  ///< half-size of the film at distance 1 (orthographic: half-size in units)
  uint32_t width_, height_;
};

/// A camera that sees the whole of `bounds`: 50 degrees, from the front, a little above and to the right.
CameraRecord frame_camera(const Bounds3& bounds);

}  // namespace shoal
