#include "engine/accuracy_plan.h"

#include <algorithm>
#include <cmath>

namespace shoal {
namespace {

/// The job's own settings at these sizes.
AccuracySettings base_at(const AccuracyJob& job, const AccuracySizes& sizes) {
  AccuracySettings base = job.base;
  base.picture.width = sizes.width, base.picture.height = sizes.height;
  base.picture.samples = sizes.samples;
  return base;
}

double predicted(const AccuracyJob& job, const AccuracySizes& sizes, const RenderPace& pace) {
  const AccuracySettings base = base_at(job, sizes);
  const auto knobs = choose_knobs(accuracy_knobs(base), job.knobs);
  const uint32_t reference = job.reference.empty() ? sizes.reference_samples : 0;
  return predicted_seconds(accuracy_work(knobs.value(), base, job.seeds, reference), pace,
                           uint64_t{sizes.width} * sizes.height);
}

/// One step down, where there is one: first the picture, down to a size at which it still shows something, then the
/// reference, then the samples, then the picture again.
bool lower(AccuracySizes& sizes, bool fixed_size) {
  constexpr uint32_t kGoodSide = 256, kFewestSamples = 4;
  const uint32_t shortest = std::min(sizes.width, sizes.height);
  const auto shrink = [&] {
    const double scale = std::max(std::sqrt(0.5), static_cast<double>(kShortestSide) / shortest);
    sizes.width = static_cast<uint32_t>(std::lround(sizes.width * scale));
    sizes.height = static_cast<uint32_t>(std::lround(sizes.height * scale));
  };
  if (!fixed_size && shortest > kGoodSide) return shrink(), true;
  if (sizes.reference_samples > 32 * sizes.samples) return sizes.reference_samples /= 2, true;
  if (sizes.samples > kFewestSamples) return sizes.samples /= 2, true;
  if (!fixed_size && shortest > kShortestSide) return shrink(), true;
  if (sizes.reference_samples > 16 * sizes.samples) return sizes.reference_samples /= 2, true;
  return false;
}

}  // namespace

RenderPace pace_of(uint64_t pixels, uint32_t few, double few_seconds, uint32_t more, double more_seconds) {
  RenderPace pace;
  // The longer render alone bounds the time of a sample, should the shorter one have been disturbed.
  const double whole = more_seconds / more;
  const double slope = std::clamp((more_seconds - few_seconds) / (more - few), whole / 4, whole);
  pace.seconds_a_sample = slope / static_cast<double>(pixels);
  pace.seconds_a_render = std::max(few_seconds - slope * few, 0.0);
  return pace;
}

AccuracyWork accuracy_work(const std::vector<AccuracyKnob>& knobs, const AccuracySettings& base, uint32_t seeds,
                           uint32_t reference_samples) {
  AccuracyWork work;
  // Each row with its seeds, and the base once more after it.
  const auto add = [&](uint64_t samples) {
    work.renders += seeds + 1, work.samples += samples * seeds + base.picture.samples;
  };
  add(base.picture.samples);
  for (const AccuracyKnob& knob : knobs) {
    for (size_t i = 0; i < knob.values.size(); ++i) {
      if (i == knob.value_of(base)) continue;
      AccuracySettings turned = base;
      knob.values[i].apply(turned);
      add(turned.picture.samples);
    }
  }
  // The combinations: three numbers of samples each.
  constexpr uint64_t kCombinations = 2;
  for (uint64_t i = 0; i < kCombinations; ++i) add(base.picture.samples * 21 / 4);
  work.renders += 2 * kCombinations * (seeds + 1), work.samples += 2 * kCombinations * base.picture.samples;
  if (reference_samples > 0) work.renders += 1, work.samples += reference_samples;
  return work;
}

double predicted_seconds(const AccuracyWork& work, const RenderPace& pace, uint64_t pixels) {
  constexpr double kCompareSeconds = 1e-6;  // a pixel: what a picture is compared in, engine/flip most of it
  return static_cast<double>(work.renders) * (pace.seconds_a_render + static_cast<double>(pixels) * kCompareSeconds) +
         static_cast<double>(work.samples) * static_cast<double>(pixels) * pace.seconds_a_sample;
}

AccuracySizes fit_budget(const AccuracyJob& job, const RenderPace& pace, double seconds, bool fixed_size) {
  AccuracySizes sizes = job.sizes;
  while (predicted(job, sizes, pace) > seconds && lower(sizes, fixed_size)) {
  }
  return sizes;
}

}  // namespace shoal
