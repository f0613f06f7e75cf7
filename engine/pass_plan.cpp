#include "engine/pass_plan.h"

#include <algorithm>
#include <cmath>

namespace shoal {
namespace {

constexpr double kGrowth = 3;
constexpr double kCareful = 0.75;
constexpr double kWorthwhile = 0.01;

}  // namespace

SampleSpan PassPlan::next(double seconds) {
  const uint32_t done = span_.end;
  if (done > 0) sample_seconds_ = (seconds - began_) / span_.count();
  uint32_t count = most_ - done;
  if (limit_ > 0) count = std::min(count, done == 0 ? 1 : fitting(limit_ - seconds));
  began_ = seconds;
  span_ = {done, done + count};
  if (count > 0) ++passes_count_;
  return span_;
}

uint32_t PassPlan::fitting(double seconds_left) const {
  const double done = span_.end;
  const double fit = sample_seconds_ > 0 ? seconds_left / sample_seconds_ : kGrowth * done;
  if (fit < std::max(1.0, kWorthwhile * done)) return 0;
  return static_cast<uint32_t>(std::min(kGrowth * done, std::max(1.0, kCareful * fit)));
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
