// What a picture asks of its camera beyond the scene's own record: another projection, a thin lens, distortion. All of it
// is optional, and what is not asked for costs nothing. Called by bins (options), engine/camera. Plain values.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "engine/scene_tables.h"
#include "io/result.h"

namespace shoal {

enum class Projection : uint8_t { kScene, kPerspective, kOrthographic, kEquirectangular, kFisheye };

enum class DistortionModel : uint8_t {
  kNone,
  kRadial,  ///< head-mounted displays: a pixel at radius r looks along r (1 + k1 r^2 + k2 r^4 + ...), up to six k
  kBrown,   ///< Brown-Conrady, of calibrated cameras: k1, k2, k3, p1, p2 take a direction to its pixel
};

/// In units of the picture plane at distance 1 in front of the camera, x to the right and y up.
struct Distortion {
  static constexpr size_t kMaxCoefficients = 6;
  DistortionModel model = DistortionModel::kNone;
  std::array<double, kMaxCoefficients> k{};
  bool operator==(const Distortion&) const = default;
};

struct PlanePoint {
  double x, y;
};
/// Where the pixel at `p` looks; nothing where no direction leads to it. Pure; Brown-Conrady is turned round by Newton's
/// method in double.
std::optional<PlanePoint> distorted(const Distortion& distortion, PlanePoint p);

struct LensOptions {
  Projection projection = Projection::kScene;
  float fov_degrees = 0;      ///< vertical; fisheye: across the circle; 0: the camera's (fisheye: 180)
  float height = 0;           ///< orthographic: of the picture in units of the scene; 0: the camera's
  float aperture = 0;         ///< diameter in units of the scene; 0: a pinhole, unless there is an f_stop
  float f_stop = 0;           ///< of a picture 24 mm high, in metres; 0: none
  float focus_distance = 0;   ///< along the view, to the plane that is sharp
  Distortion distortion;
  bool operator==(const LensOptions&) const = default;
};

/// The record as the picture sees it: perspective or orthographic, with angle and height as asked for.
CameraRecord seen_through(const CameraRecord& record, const LensOptions& lens);
/// kPerspective to kFisheye.
Projection projection_of(const CameraRecord& record, const LensOptions& lens);
/// The same projection through a pinhole, without distortion.
LensOptions pinhole(const LensOptions& lens);
/// Whether the options go together with each other and with the record. Fails with: kUsage.
Status check_lens(const CameraRecord& record, const LensOptions& lens);

}  // namespace shoal
