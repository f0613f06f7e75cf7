#include "engine/camera.h"

#include <algorithm>
#include <cmath>

#include "engine/math.h"

namespace shoal {
namespace {

/// A scaled node must not change the picture of a perspective camera, nor the units of xmag and ymag.
Vec3 unit_or(const Vec3& v, const Vec3& otherwise) {
  const float length = glm::length(v);
  return length > 0 && std::isfinite(length) ? v / length : otherwise;
}

/// A point of the unit disk, evenly (Shirley & Chiu 1997): squares around the middle become circles.
Vec2 on_disk(float u, float v) {
  const float a = 2 * u - 1, b = 2 * v - 1;
  if (a == 0 && b == 0) return {0, 0};
  const bool wide = a * a > b * b;
  const float radius = wide ? a : b, turn = wide ? b / a : a / b;
  const SinCos angle = sin_cos((kPi / 4) * turn);
  return wide ? Vec2(radius * angle.cos, radius * angle.sin) : Vec2(radius * angle.sin, radius * angle.cos);
}

/// f-stops are of a picture 24 mm high, the frame of small-format film, and a scene in metres as glTF's are.
float lens_radius(const LensOptions& lens, float tan_half_yfov) {
  constexpr float kHalfFilmMetres = 0.012f;
  if (lens.f_stop > 0) return 0.5f * (kHalfFilmMetres / tan_half_yfov) / lens.f_stop;
  return 0.5f * lens.aperture;
}

Affine3 with_unit_axes(const Affine3& m) {
  return {unit_or(m.column_x, {1, 0, 0}), unit_or(m.column_y, {0, 1, 0}), unit_or(m.column_z, {0, 0, 1}),
          m.translation};
}

}  // namespace

Camera::Camera(const CameraRecord& asked, uint32_t width, uint32_t height, const LensOptions& lens,
               std::span<const Affine3> keys)
    : projection_(projection_of(asked, lens)),
      distortion_(lens.distortion),
      width_(width),
      height_(height),
      keys_(keys) {
  const CameraRecord record = seen_through(asked, lens);
  camera_to_world_ = with_unit_axes(record.camera_to_world);
  scale_y_ = projection_ == Projection::kOrthographic ? record.ymag : record.tan_half_yfov;
  scale_x_ = scale_y_ * (static_cast<float>(width) / static_cast<float>(height));
  lens_radius_ = lens_radius(lens, record.tan_half_yfov);
  focus_distance_ = lens.focus_distance;
  half_fov_ = (lens.fov_degrees > 0 ? lens.fov_degrees : 180.0f) * (kPi / 360);
  const bool flat = projection_ == Projection::kPerspective || projection_ == Projection::kOrthographic;
  plain_ = flat && lens_radius_ == 0 && distortion_.model == DistortionModel::kNone;
}

Camera Camera::at(float time) const {
  constexpr float kCosOf45Degrees = 0.70710678f;
  const float place = time * static_cast<float>(keys_.size() - 1);
  const size_t key = std::min(static_cast<size_t>(place), keys_.size() - 2);
  const float s = place - static_cast<float>(key);
  Camera now = *this;
  now.keys_ = {};
  now.camera_to_world_ = with_unit_axes(keys_[key]);
  const Affine3& from = now.camera_to_world_;
  const Affine3 to = with_unit_axes(keys_[key + 1]);
  const float turn = std::min({glm::dot(from.column_x, to.column_x), glm::dot(from.column_y, to.column_y),
                               glm::dot(from.column_z, to.column_z)});
  if (s == 0 || turn < kCosOf45Degrees) return now;
  const auto between = [s](const Vec3& a, const Vec3& b) { return a * (1 - s) + b * s; };
  now.camera_to_world_ =
      with_unit_axes({between(from.column_x, to.column_x), between(from.column_y, to.column_y),
                      between(from.column_z, to.column_z), between(from.translation, to.translation)});
  return now;
}

CameraRay Camera::ray(uint32_t x, uint32_t y, const Random4& random, const Random4& lens) const {
  const float u = (static_cast<float>(x) + random.uniform(0)) / static_cast<float>(width_);
  const float v = (static_cast<float>(y) + random.uniform(1)) / static_cast<float>(height_);
  if (!plain_) {
    if (projection_ == Projection::kEquirectangular) return equirectangular_ray(u, v);
    if (projection_ == Projection::kFisheye) return fisheye_ray(u, v);
    return flat_ray(u, v, lens);
  }
  const float film_x = (2 * u - 1) * scale_x_, film_y = (1 - 2 * v) * scale_y_;
  if (projection_ == Projection::kPerspective) {
    return {camera_to_world_.translation, glm::normalize(camera_to_world_.vector({film_x, film_y, -1}))};
  }
  return {camera_to_world_.point({film_x, film_y, 0}), -camera_to_world_.column_z};
}

CameraRay Camera::flat_ray(float u, float v, const Random4& lens) const {
  const float film_x = (2 * u - 1) * scale_x_, film_y = (1 - 2 * v) * scale_y_;
  if (projection_ == Projection::kOrthographic) return through_lens({film_x, film_y, 0}, {0, 0, -1}, lens);
  const auto point = distorted(distortion_, {film_x, film_y});
  if (!point) return {Vec3(0), Vec3(0, 0, -1), false};
  return through_lens(Vec3(0), {static_cast<float>(point->x), static_cast<float>(point->y), -1}, lens);
}

/// `towards` has z = -1: what lies focus_distance_ along it is met from every point of the lens.
CameraRay Camera::through_lens(const Vec3& origin, const Vec3& towards, const Random4& lens) const {
  if (!has_aperture()) {
    return {camera_to_world_.point(origin), glm::normalize(camera_to_world_.vector(towards))};
  }
  const Vec2 disk = on_disk(lens.uniform(0), lens.uniform(1)) * lens_radius_;
  const Vec3 offset(disk, 0);
  return {camera_to_world_.point(origin + offset),
          glm::normalize(camera_to_world_.vector(towards * focus_distance_ - offset))};
}

/// The whole sphere: the middle looks ahead, the left and right borders meet behind.
CameraRay Camera::equirectangular_ray(float u, float v) const {
  const SinCos longitude = sin_cos((2 * u - 1) * kPi), latitude = sin_cos((0.5f - v) * kPi);
  const Vec3 direction(longitude.sin * latitude.cos, latitude.sin, -longitude.cos * latitude.cos);
  return {camera_to_world_.translation, glm::normalize(camera_to_world_.vector(direction))};
}

/// Equidistant: the angle from the axis grows as the distance from the middle, up to half the field of view at the rim
/// of the largest circle in the picture.
CameraRay Camera::fisheye_ray(float u, float v) const {
  const float side = static_cast<float>(std::min(width_, height_));
  const float x = (2 * u - 1) * (static_cast<float>(width_) / side);
  const float y = (1 - 2 * v) * (static_cast<float>(height_) / side);
  const float radius = std::sqrt(x * x + y * y);
  if (radius > 1) return {camera_to_world_.translation, -camera_to_world_.column_z, false};
  const SinCos angle = sin_cos(radius * half_fov_);
  const float out = radius > 0 ? angle.sin / radius : 0.0f;
  return {camera_to_world_.translation, glm::normalize(camera_to_world_.vector({x * out, y * out, -angle.cos}))};
}

RayCone Camera::cone() const {
  const auto rows = static_cast<float>(height_);
  switch (projection_) {
    case Projection::kOrthographic: return {2 * scale_y_ / rows * kConePixelShare, 0};
    case Projection::kEquirectangular: return {0, kPi / rows * kConePixelShare};
    case Projection::kFisheye: return {0, 2 * half_fov_ / static_cast<float>(std::min(width_, height_)) * kConePixelShare};
    default: return {0, 2 * scale_y_ / rows * kConePixelShare};
  }
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
