// When the rays of a picture are, of scenes where something moves while the shutter is open: each path is of one time, a
// function of its pixel and sample. Included by engine/path_ray.h and the shader. Pure.
#pragma once

#include "engine/effects.h"
#include "engine/path_state.h"
#include "engine/sampler.h"

namespace shoal {

enum class ShutterTimes : uint8_t {
  kNone,    ///< nothing moves: rays have no time
  kMiddle,  ///< the effect is forced off: all rays are of the middle
  kSpread
};

inline ShutterTimes shutter_times(const TopTree& tree, const EffectChoice& effects) {
  if (!tree.moves()) return ShutterTimes::kNone;
  return (effects.off & kEffectMotion) != 0 ? ShutterTimes::kMiddle : ShutterTimes::kSpread;
}

/// time_of() a path, in the upper half: spread over the shutter as the sampler spreads the samples of a pixel.
inline uint32_t time_bits(const PathState& path, const Sampler& sampler, ShutterTimes times) {
  if (times != ShutterTimes::kSpread) return 0x80000000u;
  return sampler.draw(path.pixel, path.sample, 0, Dimension::kTime).bits[0];
}

/// Ray::time() of all rays of a path, where anything moves.
inline float time_of(const PathState& path, const Sampler& sampler, ShutterTimes times) {
  return Ray::shutter_time(time_bits(path, sampler, times));
}

}  // namespace shoal
