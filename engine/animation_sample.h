// One channel of an animation at one time: its keys are searched and checked, its values interpolated as glTF 2.0,
// appendix C, says. Computed in double by engine/math: the same bits on every machine.
// Called by engine/pose_document. Thread rule: as its BufferFiles. Cost: one pass over the times of each input.
#pragma once

#include <map>
#include <vector>

#include "io/gltf_accessor.h"

namespace shoal {

/// Rotations between two unit quaternions, along the shorter way; s in [0, 1].
std::array<double, 4> slerp(const std::array<double, 4>& a, const std::array<double, 4>& b, double s);

class AnimationSampler {
 public:
  /// Keeps references to both.
  AnimationSampler(gltf::BufferFiles& files, const gltf::Document& document, uint32_t animation, double time)
      : files_(files), document_(document), animation_(animation), time_(time) {}

  /// 3 numbers of a translation or scale, 4 of a unit rotation, or one a morph target. Before the first key and after the
  /// last one these. Fails with: kInput (times that are not finite and increasing, values that are not finite, a rotation
  /// of length 0; named with their place), kStorage.
  Result<std::vector<double>> sample(const gltf::AnimationChannel& channel);

 private:
  /// Where the time lies among the keys of an input.
  struct Place {
    uint64_t key = 0;     ///< the last one not after the time, or the first
    bool between = false;  ///< there is a next one, and the time is after `key`
    double at = 0, next = 0;  ///< their times
  };
  Result<Place> find(const gltf::AnimationChannel& channel);
  Result<std::vector<double>> read(const gltf::AnimationChannel& channel, uint64_t key, int part);
  Error error(const gltf::AnimationChannel& channel, const char* end, uint64_t element, const std::string& expected,
              double found) const;

  gltf::BufferFiles& files_;
  const gltf::Document& document_;
  const uint32_t animation_;
  const double time_;
  std::map<uint32_t, Place> places_;  // by input accessor
};

}  // namespace shoal
