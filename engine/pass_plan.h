// Which samples a render takes between one barrier and the next, and how long the rest will take. A render without a
// limit is one pass of all its samples. With a time limit every pixel gets one sample, then passes grow until they near
// the limit, and shrink towards it: a pass is ended whole, so that every pixel has the same samples and the picture is
// that of so many samples asked for.
//
// How a pass is chosen: what a sample a pixel took in the last pass tells how many fit into the time that is left.
//   at most 3 times the samples there are: barriers cost little, few samples are told of by few
//   at most 3/4 of those that fit, if that is more than one: the last pass was not exactly like the next
//   none when not one fits, or less than 1 % of what is there: nobody would see it
// Where samples are drawn by what was seen (engine/adaptive_sampling.h), passes follow a list of levels besides: 16
// samples, 24, 32, 48, 64 and so on; so many have the pixels that are still drawn, which get fewer. Without a time limit
// the first pass has 16.
// So a render ends within 1 % of its time or one sample a pixel before the limit, if a pass takes as long as foretold.
// Called by engine/render. Plain values: the time is passed in. One thread.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "engine/sample_order.h"

namespace shoal {

class PassPlan {
 public:
  /// `limit_seconds`: 0: none.
  /// `levels`: as adaptive sampling takes them, of which `most_samples` must be even.
  /// `first`: the samples before are nobody's concern. Requires: 0 with a limit or levels.
  PassPlan(uint32_t most_samples, double limit_seconds, bool levels = false, uint32_t first = 0)
      : most_(most_samples), limit_(limit_seconds), levels_(levels) {
    state_.span = {first, first};
  }

  /// Where it stands: what checkpoints hold. Seconds since the render began, earlier parts of it included.
  struct State {
    SampleSpan span;            ///< of the pass under way
    uint32_t passes_count = 0;
    uint32_t reserved = 0;
    uint64_t pixels = 1;        ///< of the pass
    double began = 0;           ///< the pass, in seconds
  };
  const State& state() const { return state_; }
  /// Goes on in the pass of an earlier render.
  SampleSpan resume(const State& state) {
    state_ = state;
    return state_.span;
  }

  /// What every pixel gets next, so many seconds after the render began, when the pass before has ended. An empty span:
  /// nothing, the render is over. `pixels`: that the next pass draws; only their ratio from pass to pass matters.
  SampleSpan next(double seconds, uint64_t pixels = 1);
  /// How many pixels the pass that next() named last draws, where next() was not told yet.
  void begins_with(uint64_t pixels) { state_.pixels = pixels; }

  uint32_t done() const { return state_.span.end; }
  uint32_t passes_count() const { return state_.passes_count; }

 private:
  uint32_t fitting(double seconds_left, uint64_t pixels) const;

  uint32_t most_;
  double limit_;
  bool levels_;
  State state_;
  double sample_seconds_ = 0;  ///< that a sample of one of `pixels` took in the last pass
};

/// The level after so many samples a pixel.
uint32_t next_level(uint32_t samples);

/// When a render will be over. Seconds since it began; samples of all pixels together.
struct Forecast {
  uint64_t samples_total = 0;  ///< as far as one can tell
  double limit_seconds = 0;    ///< 0: none
  // What the speed is counted from: the pass before, and with it what passes cost besides.
  uint64_t samples_from = 0;
  double seconds_from = 0;
  uint64_t samples_mark = 0;
  double seconds_mark = 0;

  /// Of a render that goes on from another: what that has done. Before the first mark().
  void begins_with(uint64_t samples_done, double seconds) {
    samples_mark = samples_done;
    if (limit_seconds > 0) limit_seconds = std::max(limit_seconds - seconds, 1e-9);
  }
  /// A pass begins.
  void mark(uint64_t samples_done, double seconds);
  std::optional<double> seconds_left(uint64_t samples_done, double seconds) const;
  /// From 0 to 1.
  double fraction(uint64_t samples_done, double seconds) const;
};

}  // namespace shoal
