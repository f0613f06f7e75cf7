#include "engine/camera.h"

#include <cmath>

#include "engine/math.h"

namespace shoal {
namespace {

/// A scaled node must not change the picture of a perspective camera, nor the units of xmag and ymag.
Vec3 unit_or(const Vec3& v, const Vec3& otherwise) {
  const float length = glm::length(v);
  return length > 0 && std::isfinite(length) ? v / length : otherwise;
}

}  // namespace

Camera::Camera(const CameraRecord& record, uint32_t width, uint32_t height)
    : camera_to_world_(record.camera_to_world),
      perspective_(record.perspective != 0),
      width_(width),
      height_(height) {
  camera_to_world_.column_x = unit_or(camera_to_world_.column_x, {1, 0, 0});
  camera_to_world_.column_y = unit_or(camera_to_world_.column_y, {0, 1, 0});
  camera_to_world_.column_z = unit_or(camera_to_world_.column_z, {0, 0, 1});
  scale_y_ = perspective_ ? record.tan_half_yfov : record.ymag;
  scale_x_ = scale_y_ * (static_cast<float>(width) / static_cast<float>(height));
}

CameraRay Camera::ray(uint32_t x, uint32_t y, const Random4& random) const {
  const float u = (static_cast<float>(x) + random.uniform(0)) / static_cast<float>(width_);
  const float v = (static_cast<float>(y) + random.uniform(1)) / static_cast<float>(height_);
  const float film_x = (2 * u - 1) * scale_x_, film_y = (1 - 2 * v) * scale_y_;
  if (perspective_) {
    return {camera_to_world_.translation, glm::normalize(camera_to_world_.vector({film_x, film_y, -1}))};
  }
  return {camera_to_world_.point({film_x, film_y, 0}), -camera_to_world_.column_z};
}

CameraRecord frame_camera(const Bounds3& bounds) {
  constexpr float kHalfAngle = 25 * kPi / 180;
  const bool usable = !bounds.empty() && std::isfinite(glm::length(bounds.extent()));
  const Vec3 center = usable ? 0.5f * bounds.lo + 0.5f * bounds.hi : Vec3(0);
  float radius = usable ? 0.5f * glm::length(bounds.extent()) : 1.0f;
  if (!(radius > 0)) radius = 1;

  const SinCos angle = sin_cos(kHalfAngle);
  const Vec3 back = glm::normalize(Vec3(0.4f, 0.3f, 1.0f));  // from the front, a little above and to the right
  const Vec3 right = glm::normalize(glm::cross(Vec3(0, 1, 0), back));
  CameraRecord record{};
  record.camera_to_world = {right, glm::cross(back, right), back, center + back * (radius / angle.sin)};
  record.perspective = 1;
  record.tan_half_yfov = angle.sin / angle.cos;
  record.xmag = record.ymag = radius;
  return record;
}

}  // namespace shoal
