#include "engine/lens.h"

#include <fmt/format.h>

#include <cmath>

#include "engine/math.h"

namespace shoal {

namespace {

constexpr float kDefaultFov = 50;

double radial_factor(const Distortion& d, double r2) {
  double factor = 0;
  for (size_t i = Distortion::kMaxCoefficients; i-- > 0;) factor = (factor + d.k[i]) * r2;
  return 1 + factor;
}

/// Brown 1966, with the names of glTF's and OpenCV's world: x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y
/// + p2 (r^2 + 2 x^2), y' likewise with p1 and p2 in each other's place.
PlanePoint brown(const Distortion& d, PlanePoint p) {
  const double k1 = d.k[0], k2 = d.k[1], k3 = d.k[2], p1 = d.k[3], p2 = d.k[4];
  const double r2 = p.x * p.x + p.y * p.y;
  const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  return {p.x * radial + 2 * p1 * p.x * p.y + p2 * (r2 + 2 * p.x * p.x),
          p.y * radial + p1 * (r2 + 2 * p.y * p.y) + 2 * p2 * p.x * p.y};
}

/// The point that brown() takes to `target`. Beyond the radius where the lens folds over there is none.
std::optional<PlanePoint> undo_brown(const Distortion& d, PlanePoint target) {
  constexpr int kSteps = 32;
  constexpr double kClose = 1e-12;  // of the picture plane, relative to the point: far below a float's last bit
  const double k1 = d.k[0], k2 = d.k[1], k3 = d.k[2], p1 = d.k[3], p2 = d.k[4];
  PlanePoint p = target;
  for (int step = 0; step < kSteps; ++step) {
    const PlanePoint q = brown(d, p);
    const double ex = target.x - q.x, ey = target.y - q.y;
    const double r2 = p.x * p.x + p.y * p.y;
    const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), slope = k1 + r2 * (2 * k2 + r2 * 3 * k3);
    const double xx = radial + 2 * p.x * p.x * slope + 2 * p1 * p.y + 6 * p2 * p.x;
    const double yy = radial + 2 * p.y * p.y * slope + 6 * p1 * p.y + 2 * p2 * p.x;
    const double xy = 2 * p.x * p.y * slope + 2 * p1 * p.x + 2 * p2 * p.y;
    const double determinant = xx * yy - xy * xy;
    if (!(determinant > 0) || !(xx > 0)) return std::nullopt;
    if (std::fabs(ex) + std::fabs(ey) <= kClose * (1 + std::fabs(target.x) + std::fabs(target.y))) return p;
    p.x += (yy * ex - xy * ey) / determinant;
    p.y += (xx * ey - xy * ex) / determinant;
  }
  return std::nullopt;
}

float tan_half(float degrees) {
  const SinCos half = sin_cos(degrees * (kPi / 360));
  return half.sin / half.cos;
}

Status usage(const std::string& message) { return Error{ErrorCode::kUsage, message}; }

Status check_numbers(const LensOptions& lens) {
  const bool numbers = std::isfinite(lens.fov_degrees) && std::isfinite(lens.height) && std::isfinite(lens.aperture) &&
                       std::isfinite(lens.f_stop) && std::isfinite(lens.focus_distance);
  if (!numbers || lens.fov_degrees < 0 || lens.height < 0 || lens.aperture < 0 || lens.f_stop < 0 ||
      lens.focus_distance < 0) {
    return usage("field of view, height, aperture and focus: must be finite and not negative");
  }
  for (const double k : lens.distortion.k) {
    if (!std::isfinite(k)) return usage("distortion: coefficients must be finite");
  }
  return {};
}

}  // namespace

std::optional<PlanePoint> distorted(const Distortion& distortion, PlanePoint p) {
  switch (distortion.model) {
    case DistortionModel::kNone:
      return p;
    case DistortionModel::kRadial: {
      const double factor = radial_factor(distortion, p.x * p.x + p.y * p.y);
      if (!(factor > 0)) return std::nullopt;
      return PlanePoint{p.x * factor, p.y * factor};
    }
    case DistortionModel::kBrown:
      return undo_brown(distortion, p);
  }
  return std::nullopt;
}

Projection projection_of(const CameraRecord& record, const LensOptions& lens) {
  if (lens.projection != Projection::kScene) return lens.projection;
  return record.perspective != 0 ? Projection::kPerspective : Projection::kOrthographic;
}

CameraRecord seen_through(const CameraRecord& record, const LensOptions& lens) {
  CameraRecord seen = record;
  const Projection projection = projection_of(record, lens);
  seen.perspective = projection != Projection::kOrthographic;
  if (projection == Projection::kPerspective) {
    if (lens.fov_degrees > 0) {
      seen.tan_half_yfov = tan_half(lens.fov_degrees);
    } else if (record.perspective == 0) {
      seen.tan_half_yfov = tan_half(kDefaultFov);
    }
  }
  if (projection == Projection::kOrthographic && lens.height > 0) seen.ymag = 0.5f * lens.height;
  return seen;
}

LensOptions pinhole(const LensOptions& lens) {
  LensOptions without;
  without.projection = lens.projection, without.fov_degrees = lens.fov_degrees, without.height = lens.height;
  return without;
}

Status check_lens(const CameraRecord& record, const LensOptions& lens) {
  SHOAL_RETURN_IF_ERROR(check_numbers(lens));
  const Projection projection = projection_of(record, lens);
  const bool flat = projection == Projection::kPerspective || projection == Projection::kOrthographic;
  const bool fisheye = projection == Projection::kFisheye;
  if (lens.fov_degrees > 0 && !fisheye && projection != Projection::kPerspective) {
    return usage("a field of view: goes with a perspective or fisheye projection only");
  }
  if (lens.fov_degrees > (fisheye ? 360.0f : 179.0f)) {
    return usage(fmt::format("a field of view of {} degrees: must be at most {}", lens.fov_degrees, fisheye ? 360 : 179));
  }
  if (lens.height > 0 && projection != Projection::kOrthographic) {
    return usage("a height: goes with an orthographic projection only");
  }
  const bool aperture = lens.aperture > 0 || lens.f_stop > 0;
  if (aperture && !flat) return usage("an aperture: goes with a perspective or orthographic projection only");
  if (aperture && !(lens.focus_distance > 0)) return usage("an aperture: needs the distance that is in focus (--focus)");
  if (!aperture && lens.focus_distance > 0) return usage("a focus: needs an aperture (--aperture)");
  if (lens.f_stop > 0 && projection != Projection::kPerspective) {
    return usage("an f-stop: goes with a perspective projection only; give the aperture's diameter");
  }
  if (lens.distortion.model != DistortionModel::kNone && projection != Projection::kPerspective) {
    return usage("distortion: goes with a perspective projection only");
  }
  return {};
}

}  // namespace shoal
