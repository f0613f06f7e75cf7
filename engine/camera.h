// Camera rays: a pixel sample becomes an origin and a direction. Pure functions of their arguments.
#pragma once

#include <span>

#include "engine/lens.h"
#include "engine/ray_cone.h"
#include "engine/sampler.h"
#include "engine/scene.h"

namespace shoal {

struct CameraRay {
  Vec3 origin, direction;  ///< world space, direction of unit length
  bool seen = true;        ///< false: the lens shows nothing here, the sample stays black and clear
};

class Camera {
 public:
  /// `record` with a film of width x height; glTF's yfov is vertical; a film wider or higher than the camera's
  /// aspect ratio keeps the vertical angle. Requires: check_lens().
  /// `keys`: where it stands at even times of the shutter, if it moves; they are referred to.
  Camera(const CameraRecord& record, uint32_t width, uint32_t height, const LensOptions& lens = {},
         std::span<const Affine3> keys = {});
  bool moves() const { return !keys_.empty(); }
  /// The camera as it stands at `time`, in [0, 1] of the shutter: between two keys the axes and the place go straight, but
  /// where an axis turns by more than 45 degrees it stays as at the key before. Requires: moves().
  Camera at(float time) const;
  /// Whether ray() looks at the numbers for the lens.
  bool has_aperture() const { return lens_radius_ > 0; }
  /// Box filter one pixel wide: the point is uniform in the pixel. Pixel rows run from the top. `lens` is for the point
  /// on the aperture.
  CameraRay ray(uint32_t x, uint32_t y, const Random4& random, const Random4& lens = {}) const;
  /// Of the ray of one sample, in the middle of the picture; without what an aperture blurs.
  RayCone cone() const;

 private:
  CameraRay flat_ray(float u, float v, const Random4& lens) const;
  CameraRay equirectangular_ray(float u, float v) const;
  CameraRay fisheye_ray(float u, float v) const;
  CameraRay through_lens(const Vec3& origin, const Vec3& towards, const Random4& lens) const;

  Affine3 camera_to_world_;
  Projection projection_;
  bool plain_;               ///< perspective or orthographic through a pinhole, without distortion
  float scale_x_, scale_y_;  ///< half-size of the film at distance 1 (orthographic: half-size in units)
  float lens_radius_ = 0, focus_distance_ = 0;
  float half_fov_ = 0;       ///< fisheye: radians at the circle's rim
  Distortion distortion_;
  uint32_t width_, height_;
  std::span<const Affine3> keys_;
};

/// A camera that sees the whole of `bounds`: 50 degrees, from the front, a little above and to the right.
CameraRecord frame_camera(const Bounds3& bounds);

}  // namespace shoal
