#include "engine/animation_sample.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/math.h"

namespace shoal {

namespace {

using gltf::AnimatedPath;
using gltf::AnimationChannel;
using gltf::Interpolation;

constexpr uint64_t kRunKeys = 4096;
/// Parts of a key of a cubic spline; other keys have a value alone.
constexpr int kInTangent = 0, kValue = 1, kOutTangent = 2;

/// Closer than this the chord is the arc to within 1e-6 of a radian, and the sines lose digits.
constexpr double kNearlyParallel = 0.9995;

double length_of(const std::vector<double>& q) {
  return std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
}

std::array<double, 4> quaternion(const std::vector<double>& v) {
  const double length = length_of(v);
  return {v[0] / length, v[1] / length, v[2] / length, v[3] / length};
}

/// Hermite: value and tangent at both ends of a span of `length` seconds.
double spline(double s, double length, double v0, double out0, double in1, double v1) {
  const double s2 = s * s, s3 = s2 * s;
  return (2 * s3 - 3 * s2 + 1) * v0 + length * (s3 - 2 * s2 + s) * out0 + (3 * s2 - 2 * s3) * v1 +
         length * (s3 - s2) * in1;
}

}  // namespace

std::array<double, 4> slerp(const std::array<double, 4>& a, const std::array<double, 4>& b, double s) {
  double cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  const double sign = cosine < 0 ? -1 : 1;
  cosine = std::min(std::fabs(cosine), 1.0);
  double wa = 1 - s, wb = s;
  if (cosine < kNearlyParallel) {
    const double sine = std::sqrt((1 - cosine) * (1 + cosine));
    const double angle = arc_tangent(static_cast<float>(sine), static_cast<float>(cosine));
    wa = sin_cos(static_cast<float>((1 - s) * angle)).sin / sine;
    wb = sin_cos(static_cast<float>(s * angle)).sin / sine;
  }
  std::vector<double> sum(4);
  for (size_t i = 0; i < 4; ++i) sum[i] = wa * a[i] + sign * wb * b[i];
  return quaternion(sum);
}

Error AnimationSampler::error(const AnimationChannel& channel, const char* end, uint64_t element,
                              const std::string& expected, double found) const {
  return Error{ErrorCode::kInput,
               fmt::format("{}: animations[{}].samplers[{}].{}: element {}: expected {}, found {}", document_.path,
                           animation_, channel.sampler, end, element, expected, found)};
}

Result<AnimationSampler::Place> AnimationSampler::find(const AnimationChannel& channel) {
  const auto known = places_.find(channel.input);
  if (known != places_.end()) return known->second;
  SHOAL_ASSIGN_OR_RETURN(auto reader, gltf::AccessorReader::open(files_, document_, channel.input));
  Place place;
  std::vector<float> times;
  double before = 0;
  for (uint64_t first = 0; first < reader.count(); first += kRunKeys) {
    times.resize(std::min(kRunKeys, reader.count() - first));
    SHOAL_RETURN_IF_ERROR(reader.read_floats(first, times.size(), times));
    for (uint64_t i = 0; i < times.size(); ++i) {
      const uint64_t key = first + i;
      const double t = times[i];
      if (!std::isfinite(t) || (key > 0 && t <= before)) {
        return error(channel, "input", key, key > 0 ? fmt::format("a time after {}", before) : "a finite time", t);
      }
      if (key == 0 || t <= time_) {
        place = {key, false, t, t};
      } else if (place.key + 1 == key) {
        place.next = t;
        place.between = time_ > place.at;
      }
      before = t;
    }
  }
  places_.emplace(channel.input, place);
  return place;
}

Result<std::vector<double>> AnimationSampler::read(const AnimationChannel& channel, uint64_t key, int part) {
  SHOAL_ASSIGN_OR_RETURN(auto reader, gltf::AccessorReader::open(files_, document_, channel.output));
  const bool cubic = channel.interpolation == Interpolation::kCubicSpline;
  const uint64_t keys = document_.accessors[channel.input].count;
  const uint64_t count = channel.path == AnimatedPath::kWeights ? reader.count() / (keys * (cubic ? 3 : 1)) : 1;
  const uint64_t first = (cubic ? 3 * key + static_cast<uint64_t>(part) : key) * count;
  std::vector<float> floats(count * reader.components());
  SHOAL_RETURN_IF_ERROR(reader.read_floats(first, count, floats));
  std::vector<double> values(floats.begin(), floats.end());
  for (const double v : values) {
    if (!std::isfinite(v)) return error(channel, "output", first, "finite values", v);
  }
  if (channel.path == AnimatedPath::kRotation && part == kValue && !(length_of(values) > 0)) {
    return error(channel, "output", first, "a rotation of length 1", 0);
  }
  return values;
}

Result<std::vector<double>> AnimationSampler::sample(const AnimationChannel& channel) {
  SHOAL_ASSIGN_OR_RETURN(const Place place, find(channel));
  SHOAL_ASSIGN_OR_RETURN(std::vector<double> values, read(channel, place.key, kValue));
  const bool rotation = channel.path == AnimatedPath::kRotation;
  if (place.between && channel.interpolation != Interpolation::kStep) {
    const double length = place.next - place.at, s = (time_ - place.at) / length;
    SHOAL_ASSIGN_OR_RETURN(const std::vector<double> next, read(channel, place.key + 1, kValue));
    if (channel.interpolation == Interpolation::kCubicSpline) {
      SHOAL_ASSIGN_OR_RETURN(const std::vector<double> out, read(channel, place.key, kOutTangent));
      SHOAL_ASSIGN_OR_RETURN(const std::vector<double> in, read(channel, place.key + 1, kInTangent));
      for (size_t i = 0; i < values.size(); ++i) values[i] = spline(s, length, values[i], out[i], in[i], next[i]);
    } else if (rotation) {
      const std::array<double, 4> q = slerp(quaternion(values), quaternion(next), s);
      values.assign(q.begin(), q.end());
    } else {
      for (size_t i = 0; i < values.size(); ++i) values[i] = (1 - s) * values[i] + s * next[i];
    }
  }
  if (!rotation) return values;
  if (!(length_of(values) > 0)) return error(channel, "output", place.key, "a spline that keeps off length 0", 0);
  const std::array<double, 4> q = quaternion(values);
  return std::vector<double>(q.begin(), q.end());
}

}  // namespace shoal
