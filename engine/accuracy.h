// What accuracy costs on a scene: every knob on its own, and a few combinations, each rendered with several seeds,
// timed, and compared with a reference of many samples in which every knob that biases is at its most accurate.
// Called by `shoal accuracy` (bins/command_accuracy) and tests; engine/accuracy_report writes what it finds.
// One thread calls; renders are parallel inside. Cost: the renders; beside them about 1 us a pixel and picture.
// Memory beside a render: accuracy_kept_pictures() pictures.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "engine/accuracy_knobs.h"
#include "engine/picture_error.h"

namespace shoal {

/// Sizes that the budget may lower, never raise.
struct AccuracySizes {
  uint32_t width = 512, height = 512;
  uint32_t samples = 16;             ///< of the base
  uint32_t reference_samples = 1024;
};

struct AccuracyJob {
  AccuracySettings base;             ///< options as the user gave them
  std::vector<std::string> knobs;    ///< by name; empty: all
  ExecutionOptions execution;
  AccuracySizes sizes;
  uint32_t seeds = 4;
  double budget_seconds = 0;         ///< for everything; 0: as the sizes are
  bool may_rebuild = false;          ///< the scene is a glTF: knobs of the build can be turned
  std::optional<double> build_seconds;  ///< of the scene as it is; none: it was built before
  RgbPicture reference;              ///< given by the user, of exactly the job's size; empty: rendered
  RgbPicture reference_variance;     ///< of its mean; empty: not known
  std::optional<float> exposure;     ///< stops; none: the reference's log-mean luminance becomes 0.18
  ToneCurve curve = ToneCurve::kPbrNeutral;
};

/// A .shoal built as some row asks for.
struct AccuracyScene {
  const Scene* scene = nullptr;
  ExecutionOptions execution;
  std::optional<double> build_seconds;  ///< none: it was there already
};

struct AccuracyHooks {
  /// Opens the scene built with what `change` makes of the job's build options; only one is open beside the base.
  std::function<Result<AccuracyScene>(const std::function<void(SceneBuildOptions&)>& change)> open;
  std::function<void()> close;  ///< may be empty; lets go of what was opened: only the base is used until the next open()
  std::function<void(const std::string& stage, double fraction, double seconds)> progress;  ///< may be empty
  const std::atomic<bool>* stop = nullptr;
};

/// One setting of all knobs, measured.
struct AccuracyRow {
  std::string name;                   ///< "bounces 4"
  std::string knob, value;            ///< what is turned; "together" and a name where several are
  std::vector<std::string> settings;  ///< the value of every knob, in the order of AccuracyResult::knobs
  uint32_t samples = 0;
  bool base = false;    ///< nothing is turned
  bool pareto = false;  ///< no other row has less of both seconds and relMSE
  /// Of a render, median and range over the seeds, divided by machine_pace: what they would be had the machine been as fast
  /// as when the base was rendered.
  double seconds = 0, seconds_min = 0, seconds_max = 0;
  double machine_pace = 1;  ///< seconds that the base took when rendered again before and after this row, over its own
  std::optional<double> build_seconds;
  uint64_t disk_read_bytes = 0;  ///< of the render that took the median time
  uint64_t file_bytes = 0;
  double bytes_a_triangle = 0;   ///< of the file
  double rel_mse = 0, rel_mse_min = 0, rel_mse_max = 0;  ///< trimmed: mean and range over the seeds
  double rel_mse_all = 0;        ///< untrimmed
  double flip = 0;               ///< mean of the mean LDR-FLIP
  NoiseAndBias error;
  Estimate efficiency;           ///< 1 / (variance x seconds)
  std::string order;             ///< of traversal, that of the median render

  double bias() const;  ///< root of the bias squared; 0 where that is below 0
  /// Bias squared and the variance that a render of so many seconds would have.
  double error_in(double other_seconds) const;
};

struct AccuracyPicture {
  std::string title;
  size_t row = 0;                ///< kReferenceRow: the reference
  uint32_t width = 0, height = 0;
  std::vector<uint8_t> rgb;      ///< sRGB
  std::vector<uint8_t> errors;   ///< FLIP as colours (black, purple, orange, white); empty for the reference
  double flip = 0;               ///< mean over the crop
  static constexpr size_t kReferenceRow = ~size_t{0};
};

struct AccuracyResult {
  AccuracySizes sizes, asked;
  uint32_t seeds = 0;
  double budget_seconds = 0, total_seconds = 0;
  bool reference_given = false;
  double reference_seconds = 0;
  double reference_noise = 0;        ///< relative, as the variance of rows
  bool reference_noise_known = false;
  float exposure = 0;
  std::vector<AccuracyKnob> knobs;
  std::vector<AccuracyRow> rows;     ///< the base first, then knob by knob, then combinations
  std::vector<std::string> left_out; ///< what was not measured, and why
  uint32_t crop_x = 0, crop_y = 0;
  std::vector<AccuracyPicture> pictures;

  const AccuracyRow& base() const { return rows.front(); }
  const AccuracyRow* find(const std::string& knob, const std::string& value) const;
};

/// Fails with: what renders fail with, kUsage (knobs), kStopped.
Result<AccuracyResult> measure_accuracy(FileSystem& fs, const Scene& scene, const AccuracyJob& job,
                                        const AccuracyHooks& hooks);

/// Pictures of four floats a pixel that are kept beside each render.
uint32_t accuracy_kept_pictures(uint32_t seeds);

}  // namespace shoal
