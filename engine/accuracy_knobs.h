// The knobs that trade accuracy for time or memory, as one list: what each is called, its values from the cheapest to the
// most accurate, and how a value is set. A knob that the program learns is one entry in accuracy_knobs.cpp.
// Called by engine/accuracy and bins. Plain values.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "engine/build_scene.h"
#include "engine/render.h"
#include "io/result.h"

namespace shoal {

/// All that knobs turn.
struct AccuracySettings {
  PictureOptions picture;
  SceneBuildOptions build;
};

struct KnobValue {
  std::string name;  ///< as the option takes it
  std::function<void(AccuracySettings&)> apply;
  std::function<bool(const AccuracySettings&)> holds;  ///< these settings have this value
};

struct AccuracyKnob {
  std::string name;      ///< as --knobs has it
  std::string option;    ///< of `shoal render` or `shoal build` that sets it; empty: none does
  std::string sentence;  ///< what it trades, for people who do not know it
  /// Its values change what pictures converge to; the last one is the truth. False: it changes the noise alone.
  bool biases = false;
  bool rebuilds = false;  ///< its values are build options: each needs a .shoal of its own
  std::vector<KnobValue> values;

  static constexpr size_t kNoValue = ~size_t{0};
  /// The value that the settings have.
  size_t value_of(const AccuracySettings& settings) const;
};

inline constexpr const char* kSamplesKnob = "samples";

/// In the order of reports. `base` is where every knob stands while another one is turned: its own numbers of samples and
/// bounces are among the values.
std::vector<AccuracyKnob> accuracy_knobs(const AccuracySettings& base);

/// Those of `names`, in the list's order; all for no name. Fails with: kUsage (names the choices).
Result<std::vector<AccuracyKnob>> choose_knobs(std::vector<AccuracyKnob> knobs, const std::vector<std::string>& names);

/// Turns every knob that biases to its last value: what the reference is rendered with.
void set_truth(const std::vector<AccuracyKnob>& knobs, AccuracySettings& settings);

}  // namespace shoal
