#include "engine/pass_plan.h"

#include <algorithm>
#include <bit>

namespace shoal {
namespace {

constexpr double kGrowth = 3;
constexpr double kCareful = 0.75;
constexpr double kWorthwhile = 0.01;

}  // namespace

SampleSpan PassPlan::next(double seconds, uint64_t pixels) {
  const uint32_t done = state_.span.end;
  if (state_.span.count() > 0) {
    const double samples = static_cast<double>(state_.span.count()) * static_cast<double>(state_.pixels);
    sample_seconds_ = (seconds - state_.began) / samples;
  }
  uint32_t count = (levels_ ? std::min(next_level(done), most_) : most_) - done;
  if (limit_ > 0) count = std::min(count, done == 0 ? (levels_ ? 2 : 1) : fitting(limit_ - seconds, pixels));
  if (levels_) count &= ~1u;  // both halves
  state_.began = seconds;
  state_.pixels = pixels;
  state_.span = {done, done + count};
  if (count > 0) ++state_.passes_count;
  return state_.span;
}

uint32_t PassPlan::fitting(double seconds_left, uint64_t pixels) const {
  const double done = state_.span.end, each = sample_seconds_ * static_cast<double>(pixels);
  const double fit = each > 0 ? seconds_left / each : kGrowth * done;
  if (fit < std::max(1.0, kWorthwhile * done)) return 0;
  return static_cast<uint32_t>(std::min(kGrowth * done, std::max(1.0, kCareful * fit)));
}

uint32_t next_level(uint32_t samples) {
  constexpr uint32_t kFirst = 16;
  if (samples < kFirst) return kFirst;
  const uint32_t power = std::bit_floor(samples);
  return samples < power + power / 2 ? power + power / 2 : 2 * power;
}

void Forecast::mark(uint64_t samples_done, double seconds) {
  samples_from = samples_mark, seconds_from = seconds_mark;
  samples_mark = samples_done, seconds_mark = seconds;
  if (samples_from == samples_mark) seconds_from = seconds;  // the first pass: what came before it is not counted
}

std::optional<double> Forecast::seconds_left(uint64_t samples_done, double seconds) const {
  std::optional<double> left;
  if (samples_done > samples_from && samples_total > 0) {
    const uint64_t missing = samples_total - std::min(samples_done, samples_total);
    left = static_cast<double>(missing) * (seconds - seconds_from) / static_cast<double>(samples_done - samples_from);
  }
  if (limit_seconds > 0) left = std::min(left.value_or(limit_seconds), std::max(limit_seconds - seconds, 0.0));
  return left;
}

double Forecast::fraction(uint64_t samples_done, double seconds) const {
  const double of_samples =
      samples_total > 0 ? static_cast<double>(samples_done) / static_cast<double>(samples_total) : 0;
  const double of_time = limit_seconds > 0 ? seconds / limit_seconds : 0;
  return std::min(std::max(of_samples, of_time), 1.0);
}

}  // namespace shoal
