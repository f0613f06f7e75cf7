// How large a measurement of accuracy may be: sizes lowered until what they will take fits the time that is there.
// Called by engine/accuracy. Plain functions.
#pragma once

#include "engine/accuracy.h"

namespace shoal {

/// What two short renders say of the time that others will take.
struct RenderPace {
  double seconds_a_render = 0;  ///< whatever its size
  double seconds_a_sample = 0;  ///< of one pixel
};
/// Of renders of the same picture with few and with more samples.
RenderPace pace_of(uint64_t pixels, uint32_t few, double few_seconds, uint32_t more, double more_seconds);

/// Renders of a job: how many there are, and how many samples a pixel all of them have, with `base` samples in the base.
struct AccuracyWork {
  uint64_t renders = 0;
  uint64_t samples = 0;
};
AccuracyWork accuracy_work(const std::vector<AccuracyKnob>& knobs, const AccuracySettings& base, uint32_t seeds,
                           uint32_t reference_samples);

double predicted_seconds(const AccuracyWork& work, const RenderPace& pace, uint64_t pixels);

/// The largest sizes below `asked` (powers of two of the samples; sides by the root of two, never below kShortestSide for
/// the budget's sake) whose prediction is within `seconds`, or the smallest where none is. `fixed_size`: the picture's
/// size stays.
AccuracySizes fit_budget(const AccuracyJob& job, const RenderPace& pace, double seconds, bool fixed_size);
inline constexpr uint32_t kShortestSide = 96;

}  // namespace shoal
